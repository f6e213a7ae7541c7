"""The racing line and the speed profile that a car's own limits allow on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array, vstack
from scipy.sparse.linalg import spsolve

from sim.car import Car, CarParameters, parameters
from sim.physics.chassis import AIR_DENSITY, GRAVITY
from sim.physics.powertrain import RPM, engine_torque
from sim.track import CURVATURE, LEFT, RIGHT, TANGENT_X, TANGENT_Y, Track, X, Y

SPEEDS = np.linspace(0.0, 95.0, 96)
USED = np.linspace(0.0, 1.0, 21)
"""Shares of the largest lateral acceleration."""
REAR_RESERVE = 0.75
"""Share of the rear axle's friction ellipse to use while it also brakes or drives.

Past the peak of its rear tyres the car spins."""
Line = NDArray[np.float64]


@dataclass(frozen=True)
class Envelope:
    """Accelerations that the car can hold, m/s^2, at each of SPEEDS (m/s), and of USED where 2-D."""

    corner_front: NDArray[np.float64]  # by the grip of each axle
    corner_rear: NDArray[np.float64]
    brake: NDArray[np.float64]  # (SPEEDS, USED), by grip
    traction: NDArray[np.float64]  # (SPEEDS, USED), by the grip of the driven axle
    power: NDArray[np.float64]  # by the engine
    drag: NDArray[np.float64]

    @property
    def corner(self) -> NDArray[np.float64]:
        """Lateral acceleration that both axles can hold."""
        return np.minimum(self.corner_front, self.corner_rear)


def _axle_loads(p: CarParameters, speed: Line, acceleration_x: Line) -> tuple[Line, Line]:
    """Load on front and rear axle, N, at given speeds (m/s) and accelerations (m/s^2)."""
    wheelbase = p.a + p.b
    downforce = 0.5 * AIR_DENSITY * p.downforce_area * speed**2
    pitch = p.mass * acceleration_x * p.height / wheelbase
    front = p.mass * GRAVITY * p.b / wheelbase + downforce * p.downforce_front - pitch
    rear = p.mass * GRAVITY * p.a / wheelbase + downforce * (1 - p.downforce_front) + pitch
    return front, rear


def _axle_grip(axle: Line, transfer: Line, friction: float, slope: float, p: CarParameters) -> Line:
    """Largest force of an axle's two tyres, N, with `transfer` N moved from one to the other."""
    force = np.zeros_like(axle)
    for load in (axle / 2 - transfer, axle / 2 + transfer):
        load = np.maximum(load, 0.0)
        force += load * (friction + slope * (load - p.load_low))
    return force


@lru_cache
def envelope(car: Car) -> Envelope:
    """The car's quasi-steady limits, from the same equations as the simulator's."""
    p = parameters(car)
    wheelbase = p.a + p.b
    drag = 0.5 * AIR_DENSITY * p.drag_area * SPEEDS**2 / p.mass
    front, rear = _axle_loads(p, SPEEDS, np.zeros_like(SPEEDS))
    corner_front = corner_rear = np.full_like(SPEEDS, GRAVITY)
    for _ in range(30):
        roll = p.mass * np.minimum(corner_front, corner_rear) * p.height
        transfer_front = roll * p.roll_front / (2 * p.half_front_track)
        transfer_rear = roll * (1 - p.roll_front) / (2 * p.half_rear_track)
        most_front = _axle_grip(front, transfer_front, p.friction_y, p.friction_y_slope, p)
        most_rear = _axle_grip(rear, transfer_rear, p.friction_y, p.friction_y_slope, p)
        corner_front = most_front * wheelbase / p.b / p.mass
        corner_rear = most_rear * wheelbase / p.a / p.mass
    spin = SPEEDS / p.radius
    torque = [
        max(engine_torque(1.0, max(w * g * RPM, p.launch_rpm), p) * g * p.efficiency for g in p.ratios)
        for w in spin
    ]
    rolling = p.rolling_resistance * GRAVITY
    corner = np.minimum(corner_front, corner_rear)
    return Envelope(
        corner_front,
        corner_rear,
        _longitudinal(p, -1.0, corner),
        _longitudinal(p, 1.0, corner),
        np.array(torque) / p.radius / p.mass - rolling,
        drag,
    )


def _longitudinal(p: CarParameters, sign: float, corner: Line) -> NDArray[np.float64]:
    """Largest acceleration (sign +1) or braking (-1) by the tyres while cornering, (SPEEDS, USED).

    Bisects for the acceleration at which the first axle runs out of grip on its friction ellipse.
    """
    brakes = p.brake_torque_front + p.brake_torque_rear
    front_share = p.brake_torque_front / brakes if sign < 0 else 0.0
    speed = np.broadcast_to(SPEEDS[:, None], (len(SPEEDS), len(USED)))
    lateral = corner[:, None] * USED
    low, high = np.zeros(speed.shape), np.full(speed.shape, 60.0)
    for _ in range(30):
        tried = (low + high) / 2
        holds = np.ones(speed.shape, np.bool_)
        for axle, (load, share) in enumerate(
            zip(_axle_loads(p, speed, sign * tried), (front_share, 1 - front_share), strict=True)
        ):
            roll = p.roll_front if axle == 0 else 1 - p.roll_front
            half_track = p.half_front_track if axle == 0 else p.half_rear_track
            weight = (p.b if axle == 0 else p.a) / (p.a + p.b)
            transfer = p.mass * lateral * p.height * roll / (2 * half_track)
            most_x = _axle_grip(load, transfer, p.friction_x, p.friction_x_slope, p)
            most_y = _axle_grip(load, transfer, p.friction_y, p.friction_y_slope, p)
            used_x = p.mass * tried * share / np.maximum(most_x, 1.0)
            used_y = p.mass * lateral * weight / np.maximum(most_y, 1.0)
            holds &= used_x**2 + used_y**2 <= (1.0 if axle == 0 else REAR_RESERVE)
        low, high = np.where(holds, tried, low), np.where(holds, high, tried)
    return low


def understeer(car: Car) -> NDArray[np.float64]:
    """Front minus rear slip angle, rad, in a steady left bend, (SPEEDS, USED).

    Inverts the magic formula of each axle at its share of the largest lateral acceleration.
    """
    p = parameters(car)
    limits = envelope(car)
    lateral = limits.corner[:, None] * USED
    slips = []
    loads = _axle_loads(p, SPEEDS, np.zeros_like(SPEEDS))
    for most, load in zip((limits.corner_front, limits.corner_rear), loads, strict=True):
        used = np.minimum(lateral / most[:, None], 0.99)
        peak = p.peak_y + p.peak_y_slope * (load[:, None] * (1 + used / 2) / 2 - p.load_low)
        slips.append(peak * np.tan(np.arcsin(used) / p.shape) / p.stiffness)
    return slips[0] - slips[1]


def minimum_curvature(track: Track, margin: float) -> Line:
    """Lateral offsets (rows of the track table,) of the line of least squared curvature, m, + is left.

    Args:
        track: the circuit.
        margin: distance to keep from the edges, m.
    """
    step = 3
    table = track.table[::step]
    n = len(table)
    index = np.arange(n)
    normal = np.stack([-table[:, TANGENT_Y], table[:, TANGENT_X]], axis=1)
    ahead, behind = np.roll(index, -1), np.roll(index, 1)
    blocks, targets = [], []
    for axis, column in enumerate((X, Y)):
        rows = np.concatenate([index, index, index])
        columns = np.concatenate([ahead, index, behind])
        values = np.concatenate([normal[ahead, axis], -2 * normal[index, axis], normal[behind, axis]])
        blocks.append(coo_array((values, (rows, columns)), shape=(n, n)))
        centre = table[:, column]
        targets.append(-(centre[ahead] - 2 * centre + centre[behind]))
    bend = vstack(blocks).tocsr()
    offset = _bounded_least_squares(
        bend, np.concatenate(targets), -(table[:, RIGHT] - margin), table[:, LEFT] - margin
    )
    rows = np.arange(len(track.table))
    return np.interp(rows, np.append(index * step, len(rows)), np.append(offset, offset[0]))


def _bounded_least_squares(matrix: csr_array, target: Line, low: Line, high: Line) -> Line:
    """The x within (low, high) of least |matrix x - target|^2, by a primal barrier method."""
    square = (matrix.T @ matrix).tocsc()
    gradient_at_zero = matrix.T @ target
    x = 0.5 * (low + high)
    weight = 1.0
    while weight > 1e-9:
        for _ in range(8):
            to_low, to_high = x - low, high - x
            gradient = square @ x - gradient_at_zero - weight / to_low + weight / to_high
            hessian = square + diags_array(weight / to_low**2 + weight / to_high**2, format="csc")
            move = spsolve(hessian, -gradient)
            with np.errstate(divide="ignore"):
                room = np.where(move > 0, to_high / move, -to_low / move)
            x = x + min(1.0, 0.95 * room.min()) * move
            if np.abs(move).max() < 1e-4:
                break
        weight *= 0.2
    return x


@dataclass(frozen=True)
class Profile:
    """What a driver follows; every array is (rows of the track table,).

    Attributes:
        offset: lateral offset of the line from the centre line, m, + is left.
        heading: direction of the line relative to the centre line, rad.
        curvature: of the line, 1/m, + is left.
        speed: m/s.
        lap_s: time of a lap at these speeds.
    """

    offset: Line
    heading: Line
    curvature: Line
    speed: Line
    lap_s: float


def profile(track: Track, car: Car, offset: Line, grip: float) -> Profile:
    """Quasi-steady speed profile along a line: fastest within the car's envelope.

    Args:
        track: the circuit.
        car: the car.
        offset: (rows,) lateral offset of the line, m.
        grip: share of the envelope to use.
    """
    points = track.offset_line(offset)
    forward = np.roll(points, -1, axis=0) - points
    step = np.hypot(forward[:, 0], forward[:, 1])
    direction = np.unwrap(np.arctan2(forward[:, 1], forward[:, 0]))
    turn = np.angle(np.exp(1j * (direction - np.roll(direction, 1))))
    curvature = turn / (0.5 * (step + np.roll(step, 1)))
    kernel = np.array([1, 2, 3, 2, 1]) / 9
    curvature = np.convolve(np.concatenate([curvature[-2:], curvature, curvature[:2]]), kernel, "valid")
    slope = (np.roll(offset, -1) - np.roll(offset, 1)) / (2 * track.spacing)
    heading = np.arctan2(slope, 1 - offset * track.table[:, CURVATURE])

    limits = envelope(car)
    corner = grip * limits.corner
    bend = np.abs(curvature)
    speed = np.full(len(bend), SPEEDS[-1])
    for _ in range(20):
        speed = np.minimum(np.sqrt(np.interp(speed, SPEEDS, corner) / np.maximum(bend, 1e-6)), SPEEDS[-1])

    def held(table: NDArray[np.float64], v: float, k: float) -> float:
        at = v / SPEEDS[1]
        low = min(int(at), len(SPEEDS) - 2)
        share = min(v * v * k / (corner[low] + (at - low) * (corner[low + 1] - corner[low])), 1.0)
        row = table[low] + (at - low) * (table[low + 1] - table[low])
        return grip * float(np.interp(share, USED, row))

    rows = len(speed)
    for i in range(2 * rows - 1, -1, -1):
        here, v = i % rows, speed[(i + 1) % rows]
        gain = held(limits.brake, v, bend[here]) + np.interp(v, SPEEDS, limits.drag)
        speed[here] = min(speed[here], np.sqrt(v * v + 2 * gain * step[here]))
    for i in range(2 * rows):
        here, following = i % rows, (i + 1) % rows
        v = speed[here]
        push = min(held(limits.traction, v, bend[here]), np.interp(v, SPEEDS, limits.power))
        gain = push - np.interp(v, SPEEDS, limits.drag)
        speed[following] = min(speed[following], np.sqrt(max(v * v + 2 * gain * step[here], 1.0)))
    return Profile(offset, heading, curvature, speed, float(np.sum(step / speed)))
