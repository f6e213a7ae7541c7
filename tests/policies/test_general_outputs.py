"""From numbers to actions of any space: closed forms, elements of the space, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete, Space
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from nathlon.policies.general.outputs import Draw, IllegalActionError, Outputs
from nathlon.sim.errors import InputError

CLIP, UNSCALE = Outputs("clip", None), Outputs("unscale", None)
SCORES, CHOICES = Outputs(None, "argmax"), Outputs("clip", "choice")
RNG = np.random.default_rng(0)
UNEVEN = Box(np.array([-2.0, 0.1], np.float32), np.array([2.0, 0.5], np.float32))


def row(*values: float) -> NDArray[np.float32]:
    return np.array(values, np.float32)


@pytest.mark.parametrize(
    ("outputs", "space", "numbers", "action"),
    [
        (CLIP, UNEVEN, row(-1.5, 0.9), np.array([-1.5, 0.5], np.float32)),
        (CLIP, Box(-1.0, 1.0, (2, 1)), row(0.25, -3.0), np.array([[0.25], [-1.0]], np.float32)),
        (CLIP, Box(-1.0, 1.0, (), np.float64), row(0.25), np.array(0.25)),
        (CLIP, Box(-np.inf, np.inf, (1,)), row(70.0), row(70.0)),
        (CLIP, Box(0, 255, (2,), np.uint8), row(254.6, 300.0), np.array([255, 255], np.uint8)),
        (UNSCALE, UNEVEN, row(0.5, -1.0), np.array([1.0, 0.1], np.float32)),
        (UNSCALE, Box(-128, 127, (2,), np.int8), row(-1.0, 1.0), np.array([-128, 127], np.int8)),
        (SCORES, Discrete(3), row(0.1, 0.3, -5.0), 1),
        (SCORES, Discrete(3, start=-4), row(0.1, 0.3, 0.5), -2),
        (SCORES, Discrete(2), row(-np.inf, -9.0), 1),
        (SCORES, Discrete(3), row(1.0, 2.0, 2.0), 1),
        (SCORES, MultiDiscrete([2, 3]), row(0.0, 1.0, 5.0, 0.0, 1.0), np.array([1, 0])),
        (SCORES, MultiDiscrete([2, 2], start=[5, 7]), row(0.0, 1.0, 1.0, 0.0), np.array([6, 7])),
        (SCORES, MultiDiscrete(np.array([[2], [1]])), row(0.0, 1.0, 3.0), np.array([[1], [0]])),
        (CHOICES, Discrete(3), row(2.0), 2),
        (CHOICES, Discrete(3, start=5), np.array([7]), 7),
        (CHOICES, MultiDiscrete([2, 3], start=[0, 1]), np.array([1, 3]), np.array([1, 3])),
    ],
)
def test_closed_forms(outputs: Outputs, space: Space[Any], numbers: NDArray[Any], action: Any) -> None:
    found = outputs.decode("x", numbers, space, RNG)
    assert type(found) is type(action)
    assert space.contains(found)
    np.testing.assert_array_equal(found, action)
    assert getattr(found, "dtype", None) == getattr(action, "dtype", None)
    Outputs(outputs.box, outputs.discrete, len(numbers)).check("x", space)


@given(
    numbers=st.lists(st.floats(-1e6, 1e6, width=32), min_size=3, max_size=3),
    ends=st.lists(st.floats(-1e6, 1e6, width=32), min_size=6, max_size=6),
    kind=st.sampled_from([np.float32, np.float64, np.int64]),
)
def test_what_comes_of_finite_numbers_is_in_the_box(
    numbers: list[float], ends: list[float], kind: type[Any]
) -> None:
    bounds = np.array(ends, kind).reshape(2, 3)
    space = Box(bounds.min(0), bounds.max(0), dtype=kind)
    for outputs in (CLIP, UNSCALE):
        assert space.contains(outputs.decode("x", row(*numbers), space, RNG))


@pytest.mark.parametrize(
    ("outputs", "space", "numbers", "message"),
    [
        (CLIP, UNEVEN, row(0.0, np.nan), "expected finite numbers"),
        (UNSCALE, UNEVEN, row(0.0, np.inf), "expected finite numbers"),
        (SCORES, Discrete(2), row(0.0, np.nan), "expected numbers"),
        (SCORES, MultiDiscrete([2, 2]), row(0.0, 1.0, np.nan, 1.0), "expected numbers"),
        (CHOICES, Discrete(3), row(1.5), "expected whole numbers"),
        (CHOICES, Discrete(3), row(np.inf), "expected whole numbers"),
        (CHOICES, Discrete(3), row(np.nan), "expected whole numbers"),
        (CHOICES, Discrete(3), row(3.0), r"gives \[3.\], expected an action of Discrete\(3\)"),
        (CHOICES, Discrete(3, start=1), np.array([0]), r"gives \[0\], expected an action of"),
        (CHOICES, MultiDiscrete([2, 3]), np.array([2, 0]), "expected an action of"),
        (CHOICES, Discrete(3), np.array([2**63 - 1]), "expected an action of"),
    ],
)
def test_numbers_that_are_no_action(
    outputs: Outputs, space: Space[Any], numbers: NDArray[Any], message: str
) -> None:
    with pytest.raises(IllegalActionError, match=message):
        outputs.decode("x", numbers, space, RNG)


@pytest.mark.parametrize(
    ("outputs", "space", "count", "message"),
    [
        (CLIP, UNEVEN, 3, r"gives 3 numbers, expected 2 for the action space Box"),
        (SCORES, Discrete(3), 2, "gives 2 numbers, expected 3"),
        (SCORES, MultiDiscrete([2, 3]), 2, "gives 2 numbers, expected 5"),
        (CHOICES, MultiDiscrete([2, 3]), 5, "gives 5 numbers, expected 2"),
        (CHOICES, Discrete(3), 3, "gives 3 numbers, expected 1"),
        (CLIP, Discrete(2), 2, r"action space is Discrete\(2\), expected Box"),
        (SCORES, UNEVEN, 2, "action space is Box.*, expected Discrete or MultiDiscrete"),
        (
            CHOICES,
            MultiBinary(2),
            2,
            "action space is MultiBinary.*, expected Box or Discrete or MultiDiscrete",
        ),
        (UNSCALE, Box(0.0, np.inf, (1,)), 1, "action space is Box.*, expected a bounded Box"),
    ],
)
def test_another_space_is_refused_before_and_while_acting(
    outputs: Outputs, space: Space[Any], count: int, message: str
) -> None:
    with pytest.raises(InputError, match=f"^x.zip: {message}"):
        outputs.decode("x.zip", np.zeros(count, np.float32), space, RNG)
    with pytest.raises(InputError, match=f"^x.zip: {message}"):
        Outputs(outputs.box, outputs.discrete, count).check("x.zip", space)


def test_a_large_space_is_told_on_a_short_line() -> None:
    space = MultiDiscrete(np.arange(2, 900))
    with pytest.raises(InputError) as caught:
        SCORES.decode("x", row(0.0), space, RNG)
    assert len(str(caught.value)) < 200
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "space",
    [UNEVEN, Box(-np.inf, 1.0, (2, 2)), Discrete(5, start=3), MultiDiscrete([4, 5, 6], start=[1, 2, 3])],
)
def test_drawn_actions_follow_the_generator_alone(space: Space[Any]) -> None:
    drawn = [
        [Draw().decode("random", row(), space, rng) for _ in range(20)]
        for rng in map(np.random.default_rng, (1, 1, 2))
    ]
    assert all(space.contains(action) for action in drawn[0])
    np.testing.assert_array_equal(drawn[0], drawn[1])
    assert not np.array_equal(drawn[0], drawn[2])
    assert len({str(action) for action in drawn[0]}) > 3


def test_drawing_leaves_the_generator_of_the_space() -> None:
    spaces = [MultiDiscrete([100, 100]) for _ in range(2)]
    for space in spaces:
        space.seed(3)
    Draw().decode("random", row(), spaces[0], np.random.default_rng(1))
    np.testing.assert_array_equal(spaces[0].sample(), spaces[1].sample())


def test_draws_are_uniform() -> None:
    """Chi-square of 4 degrees of freedom: beyond 23.5 once in 10,000 seeds."""
    rng, space = np.random.default_rng(4), Discrete(5)
    counts = np.bincount([Draw().decode("random", row(), space, rng) for _ in range(1000)], minlength=5)
    assert ((counts - 200.0) ** 2 / 200.0).sum() < 23.5


def test_nothing_is_drawn_of_other_spaces() -> None:
    with pytest.raises(InputError, match=r"^random: action space is Dict"):
        Draw().check("random", Dict({"a": Discrete(2)}))
