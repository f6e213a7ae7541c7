"""Measures of other worlds as expressions of quantities that they declare."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from nathlon.arena.world import WorldError
from nathlon.sim.expressions import Quantity, read_expression

if TYPE_CHECKING:
    from nathlon.arena.worlds.seat_record import SeatRecord

EVERY_SEAT: Mapping[str, Quantity] = {
    "total": Quantity("1", -1e6, 1e6, "sum of its rewards"),
    "steps": Quantity("1", 1.0, 1e6, "that it has made"),
}
"""Quantities that every seat has."""


class Formula:
    """The source of a measure: an expression of what a seat's infos add up to; see `nathlon.sim.expressions`.

    Attributes:
        text: the expression.
        unit: of its values, as people write it.
    """

    def __init__(self, text: str, quantities: Mapping[str, Quantity] | None = None) -> None:
        """A formula.

        Args:
            text: over `total`, `steps` and the quantities.
            quantities: sums of numbers in infos, by their keys, with units and ranges.

        Raises:
            InputError: if it is no expression of these.
        """
        self._expression = read_expression(text, {**EVERY_SEAT, **(quantities or {})})
        self.text, self.unit = self._expression.text, str(self._expression.unit)

    def __call__(self, seat: SeatRecord) -> float:
        """Its value for a seat.

        Raises:
            WorldError: if the infos lack a quantity, or it is not finite.
        """
        seen = {"total": seat.total, "steps": float(seat.steps), **seat.infos}
        readings = {}
        for name in self._expression.names:
            if not np.isfinite(seen.get(name, np.nan)):
                raise WorldError(f"{self.text}: is to come from infos, where {name!r} is no finite number")
            readings[name] = np.array(seen[name])
        return float(self._expression(readings))
