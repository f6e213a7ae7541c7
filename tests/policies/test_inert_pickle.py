"""Pickles read as data: arrays, spaces and statistics as they were, and nothing that runs."""

from __future__ import annotations

import os
import pickle
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete, Space, Tuple

from nathlon.policies.sources.inert_pickle import MOST_OPCODES, array_of, read_pickle
from nathlon.policies.sources.pickled_space import space_of
from nathlon.policies.sources.vec_normalize import Statistics
from nathlon.sim.errors import InputError
from tests.support.refusals import refusal
from tests.support.spoiling import spoilt_bytes

SAVED = Path(__file__).parent.parent / "data" / "sb3"
SPACES: list[Space[Any]] = [
    Box(np.array([0.0, -1.0]), np.array([1.0, np.inf]), dtype=np.float64),
    Box(0, 255, (2, 3, 1), np.uint8),
    MultiDiscrete(np.array([[2, 3], [4, 5]])),
    Dict(
        {"b": Box(-1.0, 1.0, (2,)), "a": Tuple([Discrete(3, start=2), MultiBinary(3), MultiBinary((2, 2))])}
    ),
]
ARRAYS = [
    np.arange(6.0).reshape(2, 3),
    np.asfortranarray(np.arange(6).reshape(2, 3)),
    np.zeros((0, 2), ">f4"),
]


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_arrays_and_spaces_are_read_as_they_were(protocol: int) -> None:
    for array in (*ARRAYS, np.float32(2.5), np.True_):
        found = array_of(read_pickle(pickle.dumps(array, protocol)))
        np.testing.assert_array_equal(found, array)
        assert found.dtype == np.asarray(array).dtype.newbyteorder("=")
    for space in SPACES:
        space.seed(0)
        assert space_of(read_pickle(pickle.dumps(space, protocol))) == space


@pytest.mark.parametrize("version", ["1.8.0", "2.0.0", "2.3.2"])
def test_statistics_of_all_versions_are_read(version: str) -> None:
    path = SAVED / version / "ppo_vecnormalize_8_steps.pkl"
    normal = Statistics.read(path, path.read_bytes()).by_key[""]
    assert normal.bound == 1.5
    rows = np.random.default_rng(0).normal(3.0, 5.0, (1000, 3))[:100] * [1.0, 2.0, 0.5]
    np.testing.assert_allclose(normal.mean, rows.mean(axis=0), rtol=1e-4)
    np.testing.assert_allclose(normal.deviation, rows.std(axis=0), rtol=1e-3)


class Call:
    """What asks for a function to be called when it is unpickled."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self.call = function, arguments

    def __reduce__(self) -> Any:
        return self.call


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_nothing_is_called(tmp_path: Path, protocol: int) -> None:
    harm = tmp_path / "harm"
    for call in (
        Call(os.system, f"touch {harm}"),
        Call(eval, f"open({str(harm)!r}, 'w')"),
        Call(getattr, "", "upper"),
        Call(np.fromfile, str(harm)),
    ):
        with pytest.raises(ValueError, match="names "):
            read_pickle(pickle.dumps({"obs_rms": call}, protocol))
    assert not harm.exists()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\x80\x04." + bytes(1 << 26), "has 67108867 bytes"),
        (b"\x80\x04" + b"]0" * MOST_OPCODES + b"N.", "more than 50000 instructions"),
        (b"\x80\x04Nr\xff\xff\xff\x7f.", "place 2147483647"),
        (b"\x80\x04cos\nsystem\n.", r"names os\.system"),
        (b"\x80\x04\x82\x01.", "EXT1"),
        (b"\x80\x04Pwhere\n.", "PERSID"),
        (b"\x80\x04\x8e" + struct.pack("<Q", 1 << 40) + b".", "expected 1099511627776 bytes"),
        (b"", "pickle exhausted"),
    ],
)
def test_what_would_take_too_much_is_refused(content: bytes, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_pickle(content)


@pytest.mark.parametrize(
    ("shape", "data"),
    [((2, 3), b"\0" * 8), ((1 << 40, 1 << 40), b""), ((-1, 8), b"\0" * 8), ((True,), b"\0" * 8)],
)
def test_an_array_holds_what_it_says(shape: Any, data: bytes) -> None:
    found = read_pickle(pickle.dumps(np.zeros(1)))
    found.state = (1, shape, found.state[2], False, data)
    with pytest.raises(ValueError, match="array"):
        array_of(found)
    objects = read_pickle(pickle.dumps(np.array([None])))
    with pytest.raises(ValueError, match="expected"):
        array_of(objects)


def test_damaged_statistics_are_refused_in_a_sentence() -> None:
    path = SAVED / "2.3.2" / "ppo_vecnormalize_8_steps.pkl"
    rng, refused = np.random.default_rng(0), list[str]()
    for _ in range(150):
        content = spoilt_bytes(path.read_bytes(), rng)
        try:
            statistics = Statistics.read(path, content)
            for normal in statistics.by_key.values():
                normal(np.zeros((1, *normal.mean.shape)))
        except InputError as error:
            refused.append(str(error))
    assert len(refused) > 75
    assert all(said.startswith(f"{path}: ") and said.isprintable() and len(said) < 600 for said in refused)


def test_other_statistics_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.pkl"
    read = (SAVED / "2.3.2" / "ppo_vecnormalize_8_steps.pkl").read_bytes()
    for content, message in (
        (pickle.dumps({"mean": np.zeros(3)}), "no VecNormalize, expected what VecNormalize.save writes"),
        (read.replace(b"\x8c\x07epsilon", b"\x8c\x07epsilan"), "expected an array of numbers"),
        (read.replace(b"\x8c\x07obs_rms", b"\x8c\x07obs_rmz"), "obs_rms has no mean and variance"),
    ):
        with refusal(path, message):
            Statistics.read(path, content)
