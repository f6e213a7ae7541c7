"""Vectors in kernels against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nathlon.sim.kernel import lean_kernel
from nathlon.sim.simd import (
    LANES,
    absolute,
    add,
    ceil,
    copysign,
    divide,
    floor,
    fma,
    greater,
    load,
    logical_or,
    multiply,
    negate,
    select,
    sqrt,
    store,
    subtract,
)

ROW = 11


@lean_kernel
def combine(a: np.ndarray, b: np.ndarray, at: int, out: np.ndarray) -> None:
    x, y = load(a, at), load(b, at)
    for row, value in enumerate(
        (
            add(x, y),
            subtract(x, y),
            multiply(x, y),
            divide(x, y),
            negate(x),
            absolute(x),
            sqrt(absolute(x)),
            floor(x),
            ceil(x),
            copysign(x, y),
            select(greater(x, y), x, y),
            select(logical_or(greater(x, y), greater(y, x)), x, add(y, y)),
        )
    ):
        store(out[row], at, value)


def rows(dtype: type[np.floating]) -> st.SearchStrategy[np.ndarray]:
    elements = st.floats(width=32 if dtype is np.float32 else 64, allow_nan=False, allow_infinity=False)
    return arrays(dtype, (ROW,), elements=elements)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@settings(max_examples=100, deadline=None)
@given(data=st.data(), at=st.integers(0, ROW - LANES))
def test_four_numbers_from_anywhere_in_a_row_are_those_of_numpy(
    dtype: type[np.floating], data: st.DataObject, at: int
) -> None:
    a, b = data.draw(rows(dtype)), data.draw(rows(dtype))
    came = np.full((12, ROW), 7.0, dtype)
    combine(a, b, at, came)
    there = slice(at, at + LANES)
    x, y = a[there], b[there]
    with np.errstate(all="ignore"):
        expected = [
            x + y,
            x - y,
            x * y,
            x / y,
            -x,
            np.abs(x),
            np.sqrt(np.abs(x)),
            np.floor(x),
            np.ceil(x),
            np.copysign(x, y),
            np.maximum(x, y),
            np.where(x == y, y + y, x),
        ]
    beside = np.delete(came, np.r_[there], axis=1)
    np.testing.assert_array_equal(beside, np.full_like(beside, 7.0))
    np.testing.assert_array_equal(came[:, there], expected)


@lean_kernel
def remainder(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    x, y = load(a, 0), load(b, 0)
    product = multiply(x, y)
    store(out[0], 0, product)
    store(out[1], 0, fma(x, y, negate(product)))


def test_a_product_and_a_sum_are_rounded_once() -> None:
    x = np.array([1.0 + 2.0**-40, 3.0, -1.0 - 2.0**-30, 0.0])
    came = np.zeros((2, LANES))
    remainder(x, x, came)
    np.testing.assert_array_equal(came[0], x * x)
    np.testing.assert_array_equal(came[1], [2.0**-80, 0.0, 2.0**-60, 0.0])


@lean_kernel
def with_one(a: np.ndarray, one: float, out: np.ndarray) -> None:
    store(out[0], 0, divide(one, load(a, 0)))
    store(out[1], 0, select(greater(load(a, 0), one), one, load(a, 0)))


def test_one_number_stands_for_four() -> None:
    a = np.array([1.0, 2.0, 4.0, 8.0])
    came = np.zeros((2, LANES))
    with_one(a, 3.0, came)
    np.testing.assert_array_equal(came, [3.0 / a, np.minimum(a, 3.0)])
