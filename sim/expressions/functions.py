"""The functions of the language: what they take, and between which bounds their values lie."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from nathlon.sim.errors import InputError
from nathlon.sim.expressions.part import ExpressionPart, Function, Range
from nathlon.sim.expressions.unit import NUMBER, Unit

UNBOUNDED = 700.0
"""exp of more is no number."""


class Builtin(NamedTuple):
    """A function.

    Attributes:
        least, most: how many arguments it takes.
        function: computes it.
        unit: of its value, given the arguments; raises an InputError if their units do not fit.
        range: of its value, given those of the arguments; raises an InputError where it has none.
        meaning: in words.
    """

    least: int
    most: int
    function: Function
    unit: Callable[[Sequence[ExpressionPart]], Unit | None]
    range: Callable[[Sequence[Range]], Range]
    meaning: str


def common(parts: Sequence[ExpressionPart]) -> Unit | None:
    """The unit that parts share; None if any will do.

    Raises:
        InputError: if they have different ones.
    """
    units = [part.unit for part in parts if part.unit is not None]
    for unit in units[1:]:
        if unit != units[0]:
            raise InputError(f"{units[0]} and {unit} do not go together")
    return units[0] if units else None


def _number(parts: Sequence[ExpressionPart]) -> Unit:
    [part] = parts
    if part.dimension != NUMBER:
        raise InputError(f"the argument is in {part.dimension}, expected a pure number")
    return NUMBER


def _root_unit(parts: Sequence[ExpressionPart]) -> Unit | None:
    [part] = parts
    return part.unit if part.unit is None else part.unit ** Fraction(1, 2)


def _absolute(ranges: Sequence[Range]) -> Range:
    [(low, high)] = ranges
    return Range(max(low, -high, 0.0), max(-low, high))


def _rising(function: Callable[[float], float]) -> Callable[[Sequence[Range]], Range]:
    """The range of a function that never falls."""
    return lambda ranges: Range(function(ranges[0].low), function(ranges[0].high))


def _root(ranges: Sequence[Range]) -> Range:
    [(low, high)] = ranges
    if low < 0.0:
        raise InputError(f"the argument may be as low as {low:g}, expected none below 0")
    return Range(math.sqrt(low), math.sqrt(high))


def _logarithm(ranges: Sequence[Range]) -> Range:
    [(low, high)] = ranges
    if low <= 0.0:
        raise InputError(f"the argument may be as low as {low:g}, expected above 0")
    return Range(math.log(low), math.log(high))


def _exponential(ranges: Sequence[Range]) -> Range:
    [(low, high)] = ranges
    return Range(math.exp(min(low, UNBOUNDED)), math.exp(min(high, UNBOUNDED)))


def _least(ranges: Sequence[Range]) -> Range:
    return Range(min(low for low, _ in ranges), min(high for _, high in ranges))


def _greatest(ranges: Sequence[Range]) -> Range:
    return Range(max(low for low, _ in ranges), max(high for _, high in ranges))


def _clipped(ranges: Sequence[Range]) -> Range:
    value, low, high = ranges
    return _least([_greatest([value, low]), high])


def _smallest(*values: np.ndarray) -> np.ndarray:
    return np.minimum.reduce(np.broadcast_arrays(*values))


def _largest(*values: np.ndarray) -> np.ndarray:
    return np.maximum.reduce(np.broadcast_arrays(*values))


def _wave(ranges: Sequence[Range]) -> Range:
    return Range(-1.0, 1.0)


FUNCTIONS: dict[str, Builtin] = {
    "abs": Builtin(1, 1, np.abs, common, _absolute, "magnitude"),
    "min": Builtin(2, 10, _smallest, common, _least, "the smallest"),
    "max": Builtin(2, 10, _largest, common, _greatest, "the largest"),
    "clip": Builtin(
        3, 3, np.clip, common, _clipped, "the first, but not below the second nor above the third"
    ),
    "sqrt": Builtin(1, 1, np.sqrt, _root_unit, _root, "square root"),
    "exp": Builtin(1, 1, np.exp, _number, _exponential, "e to the power"),
    "log": Builtin(1, 1, np.log, _number, _logarithm, "natural logarithm"),
    "tanh": Builtin(1, 1, np.tanh, _number, _rising(math.tanh), "hyperbolic tangent: softly from -1 to 1"),
    "sin": Builtin(1, 1, np.sin, _number, _wave, "sine of an angle in rad"),
    "cos": Builtin(1, 1, np.cos, _number, _wave, "cosine of an angle in rad"),
}
