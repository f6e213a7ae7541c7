"""Tyre forces: the magic formula with combined slip by similarity, friction falling with load.

Source: Perantoni & Limebeer, "Optimal control for a Formula One car with variable parameters"
(Vehicle System Dynamics 52, 2014), appendix A.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.car import CarParameters
from nathlon.sim.kernel import lean_inlined
from nathlon.sim.simd import add, divide, fma, greater, load, multiply, negate, select, sqrt, subtract
from nathlon.sim.tyre_curve import CELLS

WORN_GRIP = 0.12
"""Share of the grip that a tyre has lost when it is worn out."""
SPENT_GRIP = 0.4
"""Share of the grip lost for each further wear beyond that."""
LEAST_GRIP = 0.5
GONE = 1.75
"""Wear from which on a tyre has its least grip, and wears no more."""

Four = tuple[float, float, float, float]
"""A number of each wheel: front left, front right, rear left, rear right."""


class Ground(NamedTuple):
    """What is under the tyres; each is (4,) float64.

    Attributes:
        grip: 1 is a new tyre on dry road.
        drag: rolling resistance, share of the load.
        shake: what kerbs make of each tyre's load, 1 is nothing.
    """

    grip: NDArray[np.float64]
    drag: NDArray[np.float64]
    shake: NDArray[np.float64]


@lean_inlined
def broadcast(number: float) -> Four:
    """The same number for each wheel."""
    return number, number, number, number


@lean_inlined
def maximum(a: Four, b: Four) -> Four:
    """The higher of two numbers of each wheel."""
    return select(greater(b, a), b, a)


@lean_inlined
def minimum(a: Four, b: Four) -> Four:
    """The lower of two numbers of each wheel."""
    return select(greater(a, b), b, a)


@lean_inlined
def curve_shape(combined: Four, curve: np.ndarray) -> Four:
    """The magic formula over the combined slip, of the table that `nathlon.sim.tyre_curve` makes."""
    at = multiply(divide(combined, add(combined, 1.0)), float(CELLS))
    a, b = min(int(at[0]), CELLS - 1), min(int(at[1]), CELLS - 1)
    c, d = min(int(at[2]), CELLS - 1), min(int(at[3]), CELLS - 1)
    at = subtract(at, (float(a), float(b), float(c), float(d)))
    of_a, of_b, of_c, of_d = load(curve[a], 0), load(curve[b], 0), load(curve[c], 0), load(curve[d], 0)
    shape = fma(at, (of_a[3], of_b[3], of_c[3], of_d[3]), (of_a[2], of_b[2], of_c[2], of_d[2]))
    shape = fma(at, shape, (of_a[1], of_b[1], of_c[1], of_d[1]))
    return fma(at, shape, (of_a[0], of_b[0], of_c[0], of_d[0]))


@lean_inlined
def tyre_force(
    slip_ratio: Four, slip_angle: Four, loads: Four, grip: Four, p: CarParameters
) -> tuple[Four, Four, Four, Four]:
    """Forces of the four tyres on the car, each in its wheel's frame.

    Args:
        slip_ratio: longitudinal slip, + drives.
        slip_angle: rad, + pushes left.
        loads: normal loads, N.
        grip: of surface and tyre, 1 is a new tyre on dry road.
        p: the car.

    Returns:
        longitudinal force (N), lateral force (N), the secant stiffness of the longitudinal force
        (N per unit of slip ratio, never negative), and the square of the largest longitudinal force
        (N^2) that friction leaves beside the lateral one.
    """
    beyond = subtract(minimum(loads, broadcast(3.0 * p.load_low + 6000.0)), p.load_low)
    per_peak_x = divide(1.0, fma(p.peak_x_slope, beyond, p.peak_x))
    x = multiply(slip_ratio, per_peak_x)
    y = divide(slip_angle, fma(p.peak_y_slope, beyond, p.peak_y))
    shape = curve_shape(sqrt(fma(x, x, multiply(y, y))), p.curve)
    most_x = multiply(multiply(fma(p.friction_x_slope, beyond, p.friction_x), grip), loads)
    most_y = multiply(multiply(fma(p.friction_y_slope, beyond, p.friction_y), grip), loads)
    share_y = multiply(y, shape)
    left = fma(negate(share_y), share_y, broadcast(1.0))
    left = multiply(multiply(most_x, most_x), maximum(left, broadcast(0.0)))
    stiffness = multiply(multiply(most_x, shape), per_peak_x)
    return multiply(stiffness, slip_ratio), multiply(most_y, share_y), stiffness, left


@lean_inlined
def worn_grip(wear: float) -> float:
    """Share of its grip that a tyre has left."""
    return max(1.0 - WORN_GRIP * wear - SPENT_GRIP * max(wear - 1.0, 0.0), LEAST_GRIP)
