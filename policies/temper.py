"""How near the built-in driver comes to other cars."""

from __future__ import annotations

from typing import Literal, NamedTuple


class Temper(NamedTuple):
    """What the driver keeps clear of others.

    Attributes:
        passing_m: lateral distance between centres at which it passes another car.
        room_m: wanted between the flanks of two cars side by side.
        braking: m/s^2 at which it plans to slow down behind a car in its path.
        least_m: wanted to the car ahead.
        notice_s: a car ahead is passed when it will be reached within the time.
    """

    passing_m: float
    room_m: float
    braking: float
    least_m: float
    notice_s: float


TemperName = Literal["calm", "fair", "aggressive"]
FAIR: TemperName = "fair"
TEMPERS: dict[str, Temper] = {
    "calm": Temper(passing_m=3.0, room_m=1.7, braking=2.5, least_m=6.0, notice_s=2.5),
    FAIR: Temper(passing_m=2.6, room_m=1.3, braking=4.0, least_m=2.5, notice_s=2.5),
    "aggressive": Temper(passing_m=2.4, room_m=0.8, braking=6.0, least_m=1.5, notice_s=2.5),
}
"""Those that a driver can have, by name."""
