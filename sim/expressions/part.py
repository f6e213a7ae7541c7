"""A part of an expression: its unit, the range of its values, and how it is computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.expressions.unit import NUMBER, Unit

Values = NDArray[np.float64]
Readings = Mapping[str, Values]
"""Values of quantities by name, all of one shape."""
Compute = Callable[[Readings], Values]
Function = Callable[..., Values]


class Range(NamedTuple):
    """Between which numbers values lie, both included."""

    low: float
    high: float

    @classmethod
    def around(cls, values: Sequence[float]) -> Range:
        """The smallest that holds some values."""
        return cls(min(values), max(values))

    @property
    def largest(self) -> float:
        """The largest magnitude."""
        return max(abs(self.low), abs(self.high))

    @property
    def holds_zero(self) -> bool:
        """Whether 0 is in it."""
        return self.low <= 0.0 <= self.high


TRUTH = Range(0.0, 1.0)


class ExpressionPart(NamedTuple):
    """A part of an expression.

    Attributes:
        unit: None if any unit will do: that of the literal 0.
        range: of its values, given those of its quantities.
        compute: its values.
    """

    unit: Unit | None
    range: Range
    compute: Compute

    @property
    def dimension(self) -> Unit:
        """The unit, a pure number's where any will do."""
        return NUMBER if self.unit is None else self.unit


def apply(function: Function, parts: Sequence[ExpressionPart]) -> Compute:
    """How a function of parts is computed."""
    computes = [part.compute for part in parts]
    if len(computes) == 1:
        [only] = computes
        return lambda readings: function(only(readings))
    if len(computes) == 2:
        left, right = computes
        return lambda readings: function(left(readings), right(readings))
    return lambda readings: function(*(compute(readings) for compute in computes))


def constant(value: float, unit: Unit | None) -> ExpressionPart:
    """A part that is always the same."""
    number = np.asarray(value, np.float64)
    return ExpressionPart(unit, Range(value, value), lambda _: number)
