"""What the kernels read of a world and never change."""

from __future__ import annotations

from typing import NamedTuple

from nathlon.sim.car import CarParameters
from nathlon.sim.physics.chassis import Rates
from nathlon.sim.physics.course import CourseParameters
from nathlon.sim.physics.pit_lane import LaneParameters
from nathlon.sim.rules import RuleParameters


class WorldParameters(NamedTuple):
    """The kernels' view of cars, circuit, wear and fuel, and rules.

    Attributes:
        car: see `nathlon.sim.car_models.model_table`.
    """

    car: CarParameters
    course: CourseParameters
    rates: Rates
    rules: RuleParameters
    lane: LaneParameters
