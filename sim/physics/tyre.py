"""Tyre forces: the magic formula with combined slip by similarity, friction falling with load.

Source: Perantoni & Limebeer, "Optimal control for a Formula One car with variable parameters"
(Vehicle System Dynamics 52, 2014), appendix A.
"""

from __future__ import annotations

import math

from sim.car import CarParameters
from sim.kernel import inlined


@inlined
def tyre_force(
    slip_ratio: float, slip_angle: float, load: float, grip: float, p: CarParameters
) -> tuple[float, float, float]:
    """Force of one tyre on the car, in the wheel's frame.

    Args:
        slip_ratio: longitudinal slip, + drives.
        slip_angle: rad, + pushes left.
        load: normal load, N.
        grip: of the surface, 1 is dry road.
        p: the car.

    Returns:
        longitudinal force (N), lateral force (N), and the secant stiffness of the longitudinal
        force (N per unit of slip ratio), never negative.
    """
    above = min(load, 3.0 * p.load_low + 6000.0) - p.load_low
    peak_x = p.peak_x + p.peak_x_slope * above
    peak_y = p.peak_y + p.peak_y_slope * above
    x = slip_ratio / peak_x
    y = slip_angle / peak_y
    combined = math.sqrt(x * x + y * y) + 1e-9
    shape = math.sin(p.shape * math.atan(p.stiffness * combined)) / combined * grip * load
    stiffness = (p.friction_x + p.friction_x_slope * above) * shape / peak_x
    return stiffness * slip_ratio, (p.friction_y + p.friction_y_slope * above) * shape * y, stiffness
