"""What a race begins with: where its cars are, and what tyres, fuel, grip and weather it has."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.physics.course import DRY, SurfaceGrip
from nathlon.sim.weather import Weather


@dataclass(frozen=True)
class Start:
    """Where the cars of one race begin; every array is (cars,) float64, a number is that of all of them.

    Attributes:
        distance: along the centre line, m; negative is before the line.
        lateral: left of the centre line, m.
        heading: relative to the centre line, rad.
        speed: along the heading, m/s.
        finish: progress at which the run is over, m; inf for none.
        sky: which of the weathers that may come does.
        side_speed: to the left of the heading, m/s.
        yaw_rate: rad/s.
    """

    distance: NDArray[np.float64]
    lateral: NDArray[np.float64]
    heading: NDArray[np.float64]
    speed: NDArray[np.float64]
    finish: NDArray[np.float64]
    side_speed: NDArray[np.float64] | float = 0.0
    yaw_rate: NDArray[np.float64] | float = 0.0
    sky: int = field(default=0, kw_only=True)


@dataclass(frozen=True)
class Conditions:
    """What one race may have different from another with the same car.

    Attributes:
        compound: of the tyres; None is the car's own.
        wear_rate, fuel_rate: multiples of the car's figures; 0 leaves tyres new and the tank full.
        grip: of the surfaces.
        weather: what may come; none is a road as it is.
        film_mm: water on the road at the start, where there is weather.
    """

    compound: str | None = None
    wear_rate: float = 0.0
    fuel_rate: float = 0.0
    grip: SurfaceGrip = DRY
    weather: tuple[Weather, ...] = ()
    film_mm: float = 0.0
