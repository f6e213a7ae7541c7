"""Vectors in kernels against NumPy."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sim.kernel import lean_kernel
from sim.lanes import LANES, load, minus, plus, store, times

ROW = 11


@lean_kernel
def combine(
    a: np.ndarray, b: np.ndarray, at: int, sums: np.ndarray, rest: np.ndarray, much: np.ndarray
) -> None:
    store(sums, at, plus(load(a, at), load(b, at)))
    store(rest, at, minus(load(a, at), load(b, at)))
    store(much, at, times(load(a, at), load(b, at)))


ROWS = arrays(np.float32, (ROW,), elements=st.floats(width=32, allow_nan=False, allow_infinity=False))


@settings(max_examples=200, deadline=None)
@given(a=ROWS, b=ROWS, at=st.integers(0, ROW - LANES))
def test_four_numbers_from_anywhere_in_a_row_are_those_of_numpy(
    a: np.ndarray, b: np.ndarray, at: int
) -> None:
    came = np.full((3, ROW), np.float32(7.0))
    combine(a, b, at, *came)
    expected = np.full((3, ROW), np.float32(7.0))
    there = slice(at, at + LANES)
    with np.errstate(all="ignore"):
        expected[:, there] = a[there] + b[there], a[there] - b[there], a[there] * b[there]
    np.testing.assert_array_equal(came, expected)
