"""Files of policies of any environment with one thing changed where it matters: a policy or a sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete
from sb3_contrib import RecurrentPPO
from stable_baselines3 import DQN, SAC

from nathlon.policies.general import load_general
from nathlon.policies.general.checkpoint import save_general
from nathlon.policies.general.outputs import IllegalActionError
from nathlon.sim.errors import InputError
from tests.policies.test_general import BEST, CARD, PRODUCT, SCORES, SEEN, graph, tensors
from tests.policies.test_general_sb3 import UNEVEN, save
from tests.policies.test_reader_attacks import (
    ATTACKS,
    MOST_GROWTH,
    Change,
    change_entry,
    change_field,
    change_header,
    change_length,
    change_settings,
    change_weights,
    cut,
    flip,
    forget_peak,
    peak,
)

ARCHIVE = (flip, cut, change_entry, change_settings, change_weights, change_weights)
GRAPH = (flip, cut, change_field, change_field, change_field)
HEADER = (flip, cut, change_length, change_header, change_header, change_header)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A small policy of every kind."""
    folder = tmp_path_factory.mktemp("whole")
    save(DQN, folder / "dqn.zip", Discrete(3))
    save(SAC, folder / "sac.zip", UNEVEN)
    save(RecurrentPPO, folder / "lstm.zip", Discrete(3))
    graph(folder / "scores.onnx", PRODUCT)
    graph(folder / "best.onnx", SCORES, BEST, kind=7)
    save_general(folder / "card.safetensors", tensors(), CARD)
    return {path.stem: path for path in folder.iterdir()}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("name", "changes", "space"),
    [
        ("dqn", ARCHIVE, Discrete(3)),
        ("sac", ARCHIVE, UNEVEN),
        ("lstm", ARCHIVE, Discrete(3)),
        ("scores", GRAPH, Discrete(3)),
        ("best", GRAPH, Discrete(3)),
        ("card", HEADER, Box(-1.0, 1.0, (3,))),
    ],
)
def test_attacks(
    tmp_path: Path, files: dict[str, Path], name: str, changes: tuple[Change, ...], space: Any
) -> None:
    whole = files[name].read_bytes()
    seen = SEEN if files[name].suffix != ".zip" else Box(-np.inf, np.inf, (5,), np.float32)
    load_general(str(files[name]), seen, space)
    rng = np.random.default_rng(1)
    path = tmp_path / f"policy{files[name].suffix}"
    forget_peak()
    before = peak()
    said: list[str] = []
    for index in range(ATTACKS):
        path.write_bytes(changes[index % len(changes)](whole, rng))
        try:
            policy = load_general(str(path), seen, space)
        except InputError as error:
            said.append(str(error))
            continue
        memory = policy.initial_memory(2)
        outputs, after = policy.act(np.zeros((2, policy.observation_size or 0), np.float32), memory)
        assert after.shape == memory.shape
        try:
            assert all(space.contains(policy.decode(row, space, rng)) for row in outputs)
        except IllegalActionError as error:
            assert "expected" in str(error)  # noqa: PT017 - either outcome is right
    assert len(said) > ATTACKS // 5, "the changes do matter"
    assert all(sentence.startswith(f"{path}: ") for sentence in said)
    assert all(sentence.removeprefix(f"{path}: ").isprintable() for sentence in said)
    assert peak() - before < MOST_GROWTH
