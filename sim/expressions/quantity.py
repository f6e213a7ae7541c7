"""What an expression is about."""

from __future__ import annotations

from typing import NamedTuple


class Quantity(NamedTuple):
    """Something that is measured.

    Attributes:
        unit: of its values, as `nathlon.sim.expressions.unit.Unit.parse` reads it.
        low, high: between which its values lie; one beyond counts as the bound.
        meaning: in words.
    """

    unit: str
    low: float
    high: float
    meaning: str
