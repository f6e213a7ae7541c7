"""Tyre forces: the magic formula with combined slip by similarity, friction falling with load.

Source: Perantoni & Limebeer, "Optimal control for a Formula One car with variable parameters"
(Vehicle System Dynamics 52, 2014), appendix A.
"""

from __future__ import annotations

import math

from sim.car import CarParameters
from sim.kernel import lean_inlined
from sim.tyre_curve import CELLS

WORN_GRIP = 0.12
"""Share of the grip that a tyre has lost when it is worn out."""
SPENT_GRIP = 0.4
"""Share of the grip lost for each further wear beyond that."""
LEAST_GRIP = 0.5


@lean_inlined
def tyre_force(
    slip_ratio: float, slip_angle: float, load: float, grip: float, p: CarParameters
) -> tuple[float, float, float, float]:
    """Force of one tyre on the car, in the wheel's frame.

    Args:
        slip_ratio: longitudinal slip, + drives.
        slip_angle: rad, + pushes left.
        load: normal load, N.
        grip: of surface and tyre, 1 is a new tyre on dry road.
        p: the car.

    Returns:
        longitudinal force (N), lateral force (N), the secant stiffness of the longitudinal force
        (N per unit of slip ratio, never negative), and the square of the largest longitudinal force
        (N^2) that friction leaves beside the lateral one.
    """
    above = min(load, 3.0 * p.load_low + 6000.0) - p.load_low
    x = slip_ratio / (p.peak_x + p.peak_x_slope * above)
    y = slip_angle / (p.peak_y + p.peak_y_slope * above)
    combined = math.sqrt(x * x + y * y)
    at = combined / (1.0 + combined) * CELLS
    cell = min(int(at), CELLS - 1)
    at -= cell
    curve = p.curve[cell]
    shape = curve[0] + at * (curve[1] + at * (curve[2] + at * curve[3]))
    most_x = (p.friction_x + p.friction_x_slope * above) * grip * load
    most_y = (p.friction_y + p.friction_y_slope * above) * grip * load
    share_y = shape * y
    left = most_x * most_x * max(1.0 - share_y * share_y, 0.0)
    stiffness = most_x * shape / (p.peak_x + p.peak_x_slope * above)
    return stiffness * slip_ratio, most_y * share_y, stiffness, left


@lean_inlined
def worn_grip(wear: float) -> float:
    """Share of its grip that a tyre has left."""
    return max(1.0 - WORN_GRIP * wear - SPENT_GRIP * max(wear - 1.0, 0.0), LEAST_GRIP)
