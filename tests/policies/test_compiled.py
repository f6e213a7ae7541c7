"""Updates of QR-SAC as they are compiled, by themselves and in a training run.

In a module of their own: what a process needs before it can compile takes longer than the compilation.
"""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest
import torch

from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.training.log import CURVE_FILE
from nathlon.policies.training.trainer import Trainer
from tests.policies.test_training import SMALL, changed, train
from tests.support.qrsac import batches, learner

pytestmark = [
    pytest.mark.takes_long,
    pytest.mark.usefixtures("brief_laps"),
    pytest.mark.skipif(not any(map(shutil.which, ("g++", "c++", "clang++"))), reason="needs a C++ compiler"),
]


def test_learners_of_one_shape_keep_their_own_configurations() -> None:
    (batch,) = batches(1)
    for polyak in (0.5, 0.01):
        eager, compiled = (learner(compiled=each, hidden=(8,), polyak=polyak) for each in (False, True))
        for qrsac in (eager, compiled):
            qrsac.update(batch)
        torch.testing.assert_close(compiled.state_dict(), eager.state_dict(), rtol=1e-4, atol=1e-5)


def test_updates_equal_eager_ones() -> None:
    """Of rates that change with each update, too: one graph serves all."""
    changes = {"hidden": (8,), "updates": 6, "final_rates": 0.1, "final_alpha": 0.1}
    eager, compiled = learner(**changes), learner(compiled=True, **changes)  # type: ignore[arg-type]
    for batch in batches(6):
        expected, found = eager.update(batch), compiled.update(batch)
        torch.testing.assert_close(found, expected, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(compiled.state_dict(), eager.state_dict(), rtol=1e-4, atol=1e-5)


def test_a_run_leaves_checkpoints_that_drive_and_a_curve(tmp_path: Path) -> None:
    assert train(Trainer.start(tmp_path / "run", changed(checkpoint_every=4), seed=3))
    paths = sorted((tmp_path / "run" / "checkpoints").iterdir())
    assert [load_checkpoint(path).card.step for path in paths] == [4, 8]
    policy = load_checkpoint(paths[0])
    assert policy.card.seed == 3
    assert policy.card.scenarios == ("1v0", "1v3")
    assert policy.observation_spec == SMALL.observation.spec()
    rows = list(csv.DictReader((tmp_path / "run" / CURVE_FILE).open()))
    assert [int(row["updates"]) for row in rows] == [4, 8]
    assert list((tmp_path / "run" / "tensorboard").glob("events*"))
