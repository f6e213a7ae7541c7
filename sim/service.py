"""What is done at a stop."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Service:
    """What is done to a car when it stops.

    Attributes:
        compound: of the tyres that are fitted, new; None to keep those on the car.
        fuel_kg: in the tank afterwards; None to add none.
    """

    compound: str | None = None
    fuel_kg: float | None = None
