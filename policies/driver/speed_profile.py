"""The fastest quasi-steady lap along a line.

The kernels take all numbers as arguments: Numba would not notice a change of another file's constants.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.driver.envelope import Envelope
from nathlon.sim.kernel import inlined, kernel
from nathlon.sim.physics.chassis import GRAVITY
from nathlon.sim.track import BANK, CREST, CURVATURE, SLOPE, TWIST, Track

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
        grip: share of the tyres' grip to use.
        speed: on the map, m/s.
        lap_s: time of a lap at these speeds.
    """

    offset: Line
    heading: Line
    path: Path
    grip: Line
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
    # As `nathlon.sim.physics.course.feel_road`, at unit speed.
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
def corner_speed(i: int, path: Path, grip: float, limits: Envelope) -> float:
    """The fastest speed at which the tyres hold row i's bend."""
    low, high = 1.0, limits.speed_step * (len(limits.drag) - 1)
    used, _, _ = demand(high, path.curvature[i], path.climb[i], path.camber[i], path.heave[i], limits)
    if abs(used) <= grip:
        return high
    over = abs(used) - grip
    used, _, _ = demand(low, path.curvature[i], path.climb[i], path.camber[i], path.heave[i], limits)
    under = abs(used) - grip
    if under >= 0.0:
        return low
    # The rule of the false position, with the end that stays where it is halved (the Illinois method).
    kept = 0
    for _ in range(40):
        tried = (low * over - high * under) / (over - under)
        used, _, _ = demand(tried, path.curvature[i], path.climb[i], path.camber[i], path.heave[i], limits)
        beyond = abs(used) - grip
        if beyond <= 0.0:
            low, under = tried, beyond
            if kept == -1:
                over *= 0.5
            kept = -1
        else:
            high, over = tried, beyond
            if kept == 1:
                under *= 0.5
            kept = 1
        if abs(beyond) < 1e-9 or high - low < 1e-8:
            break
    return low


@kernel
def before(v: float, i: int, path: Path, grip: float, limits: Envelope) -> float:
    """The fastest speed at row i from which braking reaches v at the next."""
    used, weight, along = demand(v, path.curvature[i], path.climb[i], path.camber[i], path.heave[i], limits)
    used = abs(used) / grip
    slow = grip * look_up(limits.brake, v, weight, used, limits) + look_up(
        limits.scrub, v, weight, used, limits
    )
    slow += at_speed(limits.drag, v, limits) + along
    return math.sqrt(max(v * v + 2.0 * slow * path.step[i], 1.0))


@kernel
def after(v: float, i: int, path: Path, grip: float, limits: Envelope) -> float:
    """The fastest speed after row i that driving reaches from v there."""
    used, weight, along = demand(v, path.curvature[i], path.climb[i], path.camber[i], path.heave[i], limits)
    used = abs(used) / grip
    push = grip * look_up(limits.traction, v, weight, used, limits)
    push = min(push, at_speed(limits.power, v, limits)) - look_up(limits.scrub, v, weight, used, limits)
    push -= at_speed(limits.drag, v, limits) + along
    return math.sqrt(max(v * v + 2.0 * push * path.step[i], 1.0))


@kernel
def sweep(path: Path, grip: np.ndarray, limits: Envelope, speed: np.ndarray) -> None:
    """Fill in the speeds (rows,) that cornering, then braking, then driving allow at each row's grip."""
    rows = len(speed)
    corner = np.empty(rows)
    for i in range(rows):
        corner[i] = corner_speed(i, path, grip[i], limits)
    first = int(np.argmin(corner))
    braked = corner.copy()
    speed[first] = corner[first]
    for k in range(1, rows):
        i = (first - k) % rows
        braked[i] = min(corner[i], before(braked[(i + 1) % rows], i, path, grip[i], limits))
    for k in range(rows - 1):
        i = (first + k) % rows
        j = (i + 1) % rows
        speed[j] = min(braked[j], after(speed[i], i, path, grip[i], limits))


def profile(track: Track, offset: Line, limits: Envelope, grip: float | Line) -> Profile:
    """Quasi-steady speed profile along a line: the fastest within a car's envelope.

    Args:
        track: the circuit.
        offset: (rows,) lateral offset of the line, m.
        limits: of the car.
        grip: share of the tyres' grip to use, everywhere or (rows,).
    """
    path, heading = path_of(track, offset)
    speed = np.empty(len(offset))
    grip = np.full(len(offset), grip)
    sweep(path, grip, limits, speed)
    time = float(np.sum(2 * path.step / (speed + np.roll(speed, -1))))
    return Profile(offset, heading, path, grip, speed, time)
