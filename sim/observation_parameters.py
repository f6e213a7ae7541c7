"""What the kernel of observations reads of a spec and of a world."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.car_facts import FACTS, car_facts
from nathlon.sim.observation import ANY_CAR, CAR, STATIONS_S, WALLS, ObservationSpec
from nathlon.sim.parameters import WorldParameters
from nathlon.sim.physics.course import CourseParameters
from nathlon.sim.plan import UNPLANNED

WORN_MARGIN = 0.02  # of a practised plan's speeds, on tyres that are worn out: practice was on new ones


class LayoutParameters(NamedTuple):
    """What the kernel reads of a spec.

    Attributes:
        mean, scale: (size,) float32, of its scaling; the scale is one over the deviation.
        points: on each line of the course.
        horizon: s of travel that they span.
        ahead: length of the list of cars ahead.
        facts: how many numbers of the car there are, at the end.
        stations: (stations,) float64, s of travel to where the plan is seen; none where it is not.
        plan_pace: share of the plan's speeds that is shown.
        worn: share of them that is not, on a tyre that is worn out.
        walls: how many numbers of the room up to the walls there are.
    """

    mean: NDArray[np.float32]
    scale: NDArray[np.float32]
    points: int
    horizon: float
    ahead: int
    facts: int
    stations: NDArray[np.float64]
    plan_pace: float
    worn: float
    walls: int


@cache
def layout_parameters(spec: ObservationSpec) -> LayoutParameters:
    """The kernel's view of a spec."""
    mean, deviation = spec.scaling
    return LayoutParameters(
        mean,
        np.float32(1.0) / deviation,
        spec.course_points,
        spec.horizon_s,
        spec.cars_ahead,
        spec.facts,
        np.array(STATIONS_S if spec.planned else (), np.float64),
        float(spec.plan_pace),
        WORN_MARGIN if spec.practised_by else 0.0,
        WALLS.size if spec.walls else 0,
    )


class ViewParameters(NamedTuple):
    """What the kernel reads of a world: every number more makes each call slower.

    Attributes:
        full_lock: of the car's steering, rad.
        fuel_capacity: of the car, kg.
        facts: of `nathlon.sim.car_facts`, standardised.
        grips, peaks: (facts,) float32, what each loses of all the grip, and of all the slip at its peak; no
            numbers where there is no weather.
        course: the circuit.
        plan: the table of the plan of a lap on it.
    """

    full_lock: float
    fuel_capacity: float
    facts: NDArray[np.float32]
    grips: NDArray[np.float32]
    peaks: NDArray[np.float32]
    course: CourseParameters
    plan: NDArray[np.float64]


def view_parameters(p: WorldParameters, plan: NDArray[np.float64] = UNPLANNED) -> ViewParameters:
    """What observations need of a world, and of the plan of a lap in it."""
    mean, deviation = (part[-CAR.size :] for part in ObservationSpec(version=ANY_CAR).scaling)
    known = car_facts(p.car, p.course.surface_grip)
    facts = ((known - mean) / deviation).astype(np.float32)
    kept = slice(None) if p.rates.weather else slice(0)
    grips, peaks = (
        np.where([name.startswith(told) for name, *_ in FACTS], known / deviation, 0.0).astype(np.float32)[
            kept
        ]
        for told in ("grip_", "peak_slip_")
    )
    return ViewParameters(p.car.full_lock, p.car.fuel_capacity, facts, grips, peaks, p.course, plan)
