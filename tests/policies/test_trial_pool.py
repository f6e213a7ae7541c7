"""Trials in processes of their own."""

from __future__ import annotations

import os
from concurrent.futures.process import BrokenProcessPool

import numpy as np
import pytest

from nathlon.policies.bundled import BUNDLED
from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.trial import GROUP, Drive
from nathlon.policies.training.trial_pool import TrialPool, TrialSetup
from nathlon.sim.errors import InputError
from tests.support.trainings import polishing

CHECKPOINT = BUNDLED / "lindenring" / "lindenring-wake-028k.safetensors"


def test_it_does_not_matter_how_many_processes_drive() -> None:
    """And one that ends is no traceback."""
    config = polishing({"scenario": "1v0", "races": 1, "learners": 1})
    plans = [TrialSetup(config.rollouts[0], Pair("lindenring", "gt3"), 1, seed) for seed in (1, 2)]
    policy = load_checkpoint(CHECKPOINT)
    found: list[list[Drive]] = []
    for workers in (0, 2):
        pool = TrialPool(config.model_copy(update={"workers": workers}), CHECKPOINT)
        try:
            found.append(list(pool.drive(plans, policy)))
            if pool._processes:
                with pytest.raises(BrokenProcessPool):
                    pool._processes.submit(os._exit, 1).result()
                with pytest.raises(InputError, match="a worker process has ended"):
                    list(pool.drive(plans, policy))
        finally:
            pool.close()
    for here, there in zip(*found, strict=True):
        assert here.steps == there.steps
        assert here.reward == pytest.approx(there.reward, rel=0.01)
        # BLAS rounds by its number of threads, which grows over a minute.
        for name in ("seen", "means", "noise"):
            one, other = (getattr(drive.driven[0], name)[: 10 * GROUP] for drive in (here, there))
            np.testing.assert_allclose(one, other, atol=1e-3)
    assert found[0][0].reward != found[0][1].reward
