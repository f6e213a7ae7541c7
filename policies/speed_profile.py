"""The fastest quasi-steady lap along a line, and how its time changes with the line.

The kernels take all numbers as arguments: Numba would not notice a change of another file's constants.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from policies.envelope import Envelope
from sim.kernel import inlined, kernel
from sim.physics.chassis import GRAVITY
from sim.track import BANK, CREST, CURVATURE, SLOPE, TANGENT_X, TANGENT_Y, TWIST, Track

Line = NDArray[np.float64]


class Path(NamedTuple):
    """A closed line on the road; every array is (rows of the track table,).

    Attributes:
        curvature: on the map, 1/m, + is left.
        step: to the next row, m on the map.
        climb, camber: gradient of the road along the line and to its left.
        heave: second derivative of the road's height straight ahead, 1/m.
    """

    curvature: Line
    step: Line
    climb: Line
    camber: Line
    heave: Line


@dataclass(frozen=True)
class Profile:
    """What a driver follows; every array is (rows of the track table,).

    Attributes:
        offset: lateral offset of the line from the centre line, m, + is left.
        heading: direction of the line relative to the centre line, rad.
        path: the line on the road.
        speed: on the map, m/s.
        lap_s: time of a lap at these speeds.
    """

    offset: Line
    heading: Line
    path: Path
    speed: Line
    lap_s: float


def _slope(values: Line, spacing: float) -> Line:
    return (np.roll(values, -1, axis=0) - np.roll(values, 1, axis=0)) / (2 * spacing)


def _bend(values: Line, spacing: float) -> Line:
    return (np.roll(values, -1, axis=0) - 2 * values + np.roll(values, 1, axis=0)) / spacing**2


def curvature_and_step(track: Track, offset: Line) -> tuple[Line, Line]:
    """Curvature (1/m) and length of a row's step (m) of the line at lateral offsets."""
    points = track.offset_line(offset)[:, :2]
    (x1, y1), (x2, y2) = _slope(points, track.spacing).T, _bend(points, track.spacing).T
    stretch = np.hypot(x1, y1)
    return (x1 * y2 - y1 * x2) / stretch**3, stretch * track.spacing


def pull_back(track: Track, offset: Line, by_curvature: Line, by_step: Line) -> Line:
    """Gradient by the offsets from the gradient by `curvature_and_step` of them."""
    points = track.offset_line(offset)[:, :2]
    (x1, y1), (x2, y2) = _slope(points, track.spacing).T, _bend(points, track.spacing).T
    stretch = np.hypot(x1, y1)
    turn = (x1 * y2 - y1 * x2) / stretch**3
    along = by_step * track.spacing / stretch - 3 * by_curvature * turn / stretch**2
    share = by_curvature / stretch**3
    first = np.stack([along * x1 + share * y2, along * y1 - share * x2], axis=1)
    second = np.stack([-share * y1, share * x1], axis=1)
    by_point = _bend(second, track.spacing) - _slope(first, track.spacing)
    tangent = track.table[:, [TANGENT_X, TANGENT_Y]]
    return by_point[:, 1] * tangent[:, 0] - by_point[:, 0] * tangent[:, 1]


def path_of(track: Track, offset: Line) -> tuple[Path, Line]:
    """The line at lateral offsets (m), and its direction relative to the centre line (rad)."""
    table = track.table
    curvature, step = curvature_and_step(track, offset)
    stretch = 1.0 / (1.0 - offset * table[:, CURVATURE])
    heading = np.arctan2(_slope(offset, track.spacing) * stretch, 1.0)
    sine, cosine = np.sin(heading), np.cos(heading)
    climb = (table[:, SLOPE] + table[:, TWIST] * offset) * stretch
    bank = table[:, BANK]
    advance = cosine * stretch
    # As `sim.physics.course.feel_road`, at unit speed.
    heave = advance * (
        table[:, CREST] * advance
        + 2.0 * table[:, TWIST] * sine
        + table[:, CURVATURE] * (2.0 * climb * sine - bank * cosine)
    )
    smooth = np.array([1, 2, 3, 2, 1]) / 9
    curvature, heave = (
        np.convolve(np.concatenate([values[-2:], values, values[:2]]), smooth, "valid")
        for values in (curvature, heave)
    )
    return Path(curvature, step, climb * cosine + bank * sine, bank * cosine - climb * sine, heave), heading


@inlined
def look_up(table: np.ndarray, speed: float, weight: float, used: float, limits: Envelope) -> float:
    """A table over SPEEDS, WEIGHTS and USED, linear between its points."""
    speeds, weights, shares = table.shape
    at_v = min(max(speed / limits.speed_step, 0.0), speeds - 1.001)
    at_w = min(max(weight / limits.weight_step, 0.0), weights - 1.001)
    at_u = min(max(used, 0.0), 0.999) * (shares - 1)
    v, w, u = int(at_v), int(at_w), int(at_u)
    at_v, at_w, at_u = at_v - v, at_w - w, at_u - u
    low = table[v, w, u] + at_u * (table[v, w, u + 1] - table[v, w, u])
    high = table[v, w + 1, u] + at_u * (table[v, w + 1, u + 1] - table[v, w + 1, u])
    slow = low + at_w * (high - low)
    low = table[v + 1, w, u] + at_u * (table[v + 1, w, u + 1] - table[v + 1, w, u])
    high = table[v + 1, w + 1, u] + at_u * (table[v + 1, w + 1, u + 1] - table[v + 1, w + 1, u])
    return slow + at_v * (low + at_w * (high - low) - slow)


@inlined
def corner_limit(speed: float, weight: float, limits: Envelope) -> float:
    """Largest lateral acceleration, m/s^2."""
    speeds, weights = limits.corner.shape
    at_v = min(max(speed / limits.speed_step, 0.0), speeds - 1.001)
    at_w = min(max(weight / limits.weight_step, 0.0), weights - 1.001)
    v, w = int(at_v), int(at_w)
    at_v, at_w = at_v - v, at_w - w
    slow = limits.corner[v, w] + at_w * (limits.corner[v, w + 1] - limits.corner[v, w])
    fast = limits.corner[v + 1, w] + at_w * (limits.corner[v + 1, w + 1] - limits.corner[v + 1, w])
    return slow + at_v * (fast - slow)


@inlined
def at_speed(table: np.ndarray, speed: float, limits: Envelope) -> float:
    """A table over SPEEDS, linear between its points."""
    at = min(max(speed / limits.speed_step, 0.0), len(table) - 1.001)
    low = int(at)
    return table[low] + (at - low) * (table[low + 1] - table[low])


@inlined
def demand(
    speed: float, curvature: float, climb: float, camber: float, heave: float, limits: Envelope
) -> tuple[float, float, float]:
    """What the road asks of the tyres at a speed.

    Returns:
        share of the lateral grip used, + to the left; weight of a unit of mass on the road, m/s^2;
        gravity along the line on the map, m/s^2.
    """
    lift = max(GRAVITY + heave * speed * speed, 0.1)
    steep = 1.0 + climb * climb + camber * camber
    weight = lift / math.sqrt(steep)
    reaction = lift / steep
    lateral = math.sqrt(1.0 + camber * camber) * (curvature * speed * speed + reaction * camber)
    return lateral / corner_limit(speed, weight, limits), weight, reaction * climb


@kernel
def corner_speed(i: int, curvature: float, path: Path, grip: float, limits: Envelope) -> float:
    """The fastest speed at which the tyres hold row i's bend."""
    low, high = 1.0, limits.speed_step * (len(limits.drag) - 1)
    used, _, _ = demand(high, curvature, path.climb[i], path.camber[i], path.heave[i], limits)
    if abs(used) <= grip:
        return high
    for _ in range(34):
        tried = 0.5 * (low + high)
        used, _, _ = demand(tried, curvature, path.climb[i], path.camber[i], path.heave[i], limits)
        if abs(used) <= grip:
            low = tried
        else:
            high = tried
    return low


@kernel
def before(
    v: float, i: int, curvature: float, step: float, path: Path, grip: float, limits: Envelope
) -> float:
    """The fastest speed at row i from which braking reaches v at the next."""
    used, weight, along = demand(v, curvature, path.climb[i], path.camber[i], path.heave[i], limits)
    used = abs(used) / grip
    slow = grip * look_up(limits.brake, v, weight, used, limits) + look_up(
        limits.scrub, v, weight, used, limits
    )
    slow += at_speed(limits.drag, v, limits) + along
    return math.sqrt(max(v * v + 2.0 * slow * step, 1.0))


@kernel
def after(
    v: float, i: int, curvature: float, step: float, path: Path, grip: float, limits: Envelope
) -> float:
    """The fastest speed after row i that driving reaches from v there."""
    used, weight, along = demand(v, curvature, path.climb[i], path.camber[i], path.heave[i], limits)
    used = abs(used) / grip
    push = grip * look_up(limits.traction, v, weight, used, limits)
    push = min(push, at_speed(limits.power, v, limits)) - look_up(limits.scrub, v, weight, used, limits)
    push -= at_speed(limits.drag, v, limits) + along
    return math.sqrt(max(v * v + 2.0 * push * step, 1.0))


@kernel
def sweep(
    path: Path, grip: float, limits: Envelope, corner: np.ndarray, braked: np.ndarray, speed: np.ndarray
) -> int:
    """Fill in the speeds that cornering, then braking, then driving allow, each (rows,).

    Returns:
        the row of the slowest corner, from which the sweeps went out.
    """
    rows = len(speed)
    for i in range(rows):
        corner[i] = corner_speed(i, path.curvature[i], path, grip, limits)
    first = int(np.argmin(corner))
    braked[:] = corner
    speed[first] = corner[first]
    for k in range(1, rows):
        i = (first - k) % rows
        reached = before(braked[(i + 1) % rows], i, path.curvature[i], path.step[i], path, grip, limits)
        braked[i] = min(corner[i], reached)
    for k in range(rows - 1):
        i = (first + k) % rows
        j = (i + 1) % rows
        speed[j] = min(braked[j], after(speed[i], i, path.curvature[i], path.step[i], path, grip, limits))
    return first


@inlined
def lap_time(step: np.ndarray, speed: np.ndarray) -> float:
    """Time over all steps, s, the speed being steady from row to row in the mean."""
    total = 0.0
    rows = len(speed)
    for i in range(rows):
        total += 2.0 * step[i] / (speed[i] + speed[(i + 1) % rows])
    return total


@kernel
def time_gradient(
    path: Path, grip: float, limits: Envelope, by_curvature: np.ndarray, by_step: np.ndarray
) -> float:
    """Lap time, s, and its derivatives by curvature and step of each row.

    Goes back over the sweeps: what slows a row is another row's speed, or its own bend.
    """
    rows = len(path.step)
    corner, braked, speed = np.empty(rows), np.empty(rows), np.empty(rows)
    first = sweep(path, grip, limits, corner, braked, speed)
    weight, by_braked = np.zeros(rows), np.zeros(rows)
    for i in range(rows):
        j = (i + 1) % rows
        pair = speed[i] + speed[j]
        by_step[i] = 2.0 / pair
        by_curvature[i] = 0.0
        weight[i] -= 2.0 * path.step[i] / (pair * pair)
        weight[j] -= 2.0 * path.step[i] / (pair * pair)
    small_v, small_k, small_s = 1e-4, 1e-6, 1e-4
    for k in range(rows - 2, -1, -1):
        i = (first + k) % rows
        j = (i + 1) % rows
        if speed[j] == braked[j]:
            by_braked[j] += weight[j]
            continue
        v, bend, step = speed[i], path.curvature[i], path.step[i]
        there = speed[j]
        by_v = (after(v + small_v, i, bend, step, path, grip, limits) - there) / small_v
        by_k = (after(v, i, bend + small_k, step, path, grip, limits) - there) / small_k
        by_s = (after(v, i, bend, step + small_s, path, grip, limits) - there) / small_s
        weight[i] += weight[j] * by_v
        by_curvature[i] += weight[j] * by_k
        by_step[i] += weight[j] * by_s
    by_braked[first] += weight[first]
    for k in range(rows - 1, 0, -1):
        i = (first - k) % rows
        j = (i + 1) % rows
        bend, step = path.curvature[i], path.step[i]
        if braked[i] == corner[i]:
            faster = corner_speed(i, bend + small_k, path, grip, limits)
            by_curvature[i] += by_braked[i] * (faster - corner[i]) / small_k
            continue
        v, here = braked[j], braked[i]
        by_v = (before(v + small_v, i, bend, step, path, grip, limits) - here) / small_v
        by_k = (before(v, i, bend + small_k, step, path, grip, limits) - here) / small_k
        by_s = (before(v, i, bend, step + small_s, path, grip, limits) - here) / small_s
        by_braked[j] += by_braked[i] * by_v
        by_curvature[i] += by_braked[i] * by_k
        by_step[i] += by_braked[i] * by_s
    bend = path.curvature[first]
    faster = corner_speed(first, bend + small_k, path, grip, limits)
    by_curvature[first] += by_braked[first] * (faster - corner[first]) / small_k
    return lap_time(path.step, speed)


def profile(track: Track, offset: Line, limits: Envelope, grip: float) -> Profile:
    """Quasi-steady speed profile along a line: the fastest within a car's envelope.

    Args:
        track: the circuit.
        offset: (rows,) lateral offset of the line, m.
        limits: of the car.
        grip: share of the tyres' grip to use.
    """
    path, heading = path_of(track, offset)
    speed = np.empty(len(offset))
    sweep(path, grip, limits, np.empty_like(speed), np.empty_like(speed), speed)
    time = float(np.sum(2 * path.step / (speed + np.roll(speed, -1))))
    return Profile(offset, heading, path, speed, time)
