"""Multilayer perceptrons against the same in double precision."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest

from nathlon.policies.mlp import FEW, EncodedMlp, Mlp

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


def layers(rng: np.random.Generator) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    return tuple(
        (rng.standard_normal((into, out), np.float32), rng.standard_normal(out, np.float32))
        for into, out in pairwise(SIZES)
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
