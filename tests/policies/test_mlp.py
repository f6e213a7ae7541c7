"""Multilayer perceptrons against the same in double precision."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nathlon.policies.mlp import FEW, EncodedMlp, Mlp, MlpStack

SIZES = (7, 16, 9, 2)
Function = Callable[[np.ndarray], np.ndarray]
HIDDEN: dict[str, Function] = {
    "relu": lambda values: np.maximum(values, 0.0),
    "tanh": np.tanh,
}
OUTPUT: dict[str, Function] = {
    "tanh": np.tanh,
    "clip": lambda values: np.clip(values, -1.0, 1.0),
}


def layers(
    rng: np.random.Generator, sizes: tuple[int, ...] = SIZES
) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    return tuple(
        (rng.standard_normal((into, out), np.float32), rng.standard_normal(out, np.float32))
        for into, out in pairwise(sizes)
    )


@pytest.mark.parametrize("rows", [0, 1, FEW, FEW + 1, 40])
@pytest.mark.parametrize("hidden", ["relu", "tanh"])
@pytest.mark.parametrize("output", ["tanh", "clip"])
def test_few_rows_and_many_are_those_of_double_precision(
    rows: int, hidden: Literal["relu", "tanh"], output: Literal["tanh", "clip"]
) -> None:
    rng = np.random.default_rng(rows)
    weights, inputs = layers(rng), rng.standard_normal((rows, SIZES[0]), np.float32)
    given = inputs.copy()
    came = Mlp(weights, hidden, output)(inputs)
    expected = inputs.astype(float)
    for index, (weight, bias) in enumerate(weights, 1):
        sums = expected @ weight.astype(float) + bias
        expected = (HIDDEN[hidden] if index < len(weights) else OUTPUT[output])(sums)
    assert came.dtype == np.float32
    np.testing.assert_allclose(came, expected, rtol=0, atol=1e-4)
    np.testing.assert_array_equal(inputs, given)


@pytest.mark.parametrize("rows", [1, FEW + 1])
@pytest.mark.parametrize("hidden", ["relu", "tanh"])
def test_what_is_not_a_number_stays_so(rows: int, hidden: Literal["relu", "tanh"]) -> None:
    inputs = np.zeros((rows, SIZES[0]), np.float32)
    inputs[-1, 3] = np.nan
    came = Mlp(layers(np.random.default_rng(0)), hidden, "tanh")(inputs)
    assert np.isnan(came[-1]).all()
    assert np.isfinite(came[:-1]).all()


@pytest.mark.parametrize("rows", [0, 1, FEW, 40])
@pytest.mark.parametrize("kinds", [1, 2, 40])
def test_encoded_inputs_join_the_others(rows: int, kinds: int) -> None:
    """Also where what is encoded differs from row to row, and from call to call."""
    rng = np.random.default_rng(rows + kinds)
    weights = layers(rng)
    encoder = ((rng.standard_normal((5, 3), np.float32), rng.standard_normal(3, np.float32)),)
    network = EncodedMlp(Mlp(encoder, "relu", "relu"), Mlp(weights, "relu", "tanh"), 5)
    for _ in range(2):
        seen = rng.standard_normal((rows, SIZES[0] - 3), np.float32)
        facts = rng.standard_normal((kinds, 5), np.float32)[rng.integers(0, kinds, rows)]
        joined = np.concatenate([seen, np.maximum(facts @ encoder[0][0] + encoder[0][1], 0.0)], axis=1)
        expected = Mlp(weights, "relu", "tanh")(joined.astype(np.float32))
        np.testing.assert_allclose(network(np.concatenate([seen, facts], axis=1)), expected, atol=1e-5)


@settings(deadline=None)
@given(
    sizes=st.lists(st.integers(1, 37), min_size=2, max_size=4),
    rows=st.lists(st.integers(0, FEW), min_size=1, max_size=5),
    hidden=st.sampled_from(["relu", "tanh"]),
    seed=st.integers(0, 1000),
)
def test_what_a_row_gives_does_not_depend_on_what_is_beside_it(
    sizes: list[int], rows: list[int], hidden: Literal["relu", "tanh"], seed: int
) -> None:
    """Neither rows of the same network nor other networks, to the last bit."""
    rng = np.random.default_rng(seed)
    networks = [Mlp(layers(rng, tuple(sizes)), hidden, "tanh") for _ in rows]
    starts = np.cumsum([0, *rows])
    inputs = rng.standard_normal((starts[-1], sizes[0]), np.float32)
    inputs[rng.random(inputs.shape) < 0.5] = 0.0
    came = MlpStack(networks)(inputs, starts)
    assert came.shape == (len(inputs), sizes[-1])
    for network, begin, count in zip(networks, starts, rows, strict=False):
        for row in range(begin, begin + count):
            np.testing.assert_array_equal(network(inputs[row : row + 1])[0], came[row])
