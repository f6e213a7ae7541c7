"""The racing line: least time within the quasi-steady envelope, by an interior-point method.

Unknown are the lateral offset and the squared speed at points along the lap. Both tyres' grip (as an
ellipse), the engine and the edges of the road are limits that a logarithmic barrier keeps away from; the
barrier is lowered step by step, and each time Newton's method finds the best line. Second derivatives
of the limits themselves are left out, which keeps every step downhill.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from nathlon.policies.driver.envelope import SPEEDS, USED, WEIGHTS, Envelope, Table
from nathlon.policies.driver.margins import lacking, less, room
from nathlon.policies.driver.speed_profile import Line, path_of, profile
from nathlon.sim.physics.chassis import GRAVITY
from nathlon.sim.track import TANGENT_X, TANGENT_Y, Track, X, Y

POINT_M = 4.0
CORRECTIONS = 3
"""Searches in less room, at most, until the line keeps clear of the walls."""
SMOOTHNESS = 1e3
"""s m^3: what the square of the curvature's change costs beside time, for no car turns in at once."""
FIRST_BARRIER, LAST_BARRIER, LOWERING = 1e-2, 8e-5, 0.3
"""s: what a limit costs as its distance falls by a factor e."""
STEPS = 8
"""Newton steps at each height of the barrier, at most."""
LEAST_ENERGY = 1.0
"""m^2/s^2: the square of the slowest speed."""
START_GRIP = 0.6
"""Share of the grip with which the search begins, on the centre line."""


class NoLine(Exception):
    """The car cannot drive the circuit: at no speed do its grip and power suffice everywhere."""


_Entries = tuple[NDArray[np.int64], Line]
"""Columns of a sparse matrix, and the values there."""


class _Road(NamedTuple):
    """Points along the centre line, `spacing` metres apart; arrays are (points,)."""

    spacing: float
    x: Line
    y: Line
    normal_x: Line
    normal_y: Line
    low: Line
    high: Line
    climb: Line
    camber: Line
    heave: Line


class _Shape(NamedTuple):
    """A line's first and second derivative by the way along the centre line, its stretch and curvature."""

    x1: Line
    y1: Line
    x2: Line
    y2: Line
    stretch: Line
    curvature: Line


class _Car(NamedTuple):
    """What the car makes of a bend at a speed; arrays are (points,)."""

    by_curvature: Line  # share of the lateral grip, a unit of curvature
    used: Line  # share of the lateral grip
    resistance: Line  # of air and slope, m/s^2
    scrub: Line  # of the tyres at their lateral limit, m/s^2
    traction: Line  # m/s^2
    brake: Line
    power: Line


def _look_up(table: Table, speed: Line, weight: Line) -> Line:
    """A table over SPEEDS and WEIGHTS, linear between its points."""
    at_v = np.clip(speed / SPEEDS[1], 0.0, len(SPEEDS) - 1.001)
    at_w = np.clip(weight / WEIGHTS[1], 0.0, len(WEIGHTS) - 1.001)
    v, w = at_v.astype(np.int64), at_w.astype(np.int64)
    at_v, at_w = at_v - v, at_w - w
    slow = (1 - at_w) * table[v, w] + at_w * table[v, w + 1]
    fast = (1 - at_w) * table[v + 1, w] + at_w * table[v + 1, w + 1]
    between: Line = (1 - at_v) * slow + at_v * fast
    return between


class _Search:
    """The line and its speeds while they are sought."""

    def __init__(self, track: Track, limits: Envelope, grip: float, left: Line, right: Line) -> None:
        rows = len(track.table)
        count = round(track.length / POINT_M)
        self.rows, self.at = rows, np.arange(count) * rows / count
        self.limits, self.grip = limits, grip
        self.middle = np.arange(count, dtype=np.int64)
        self.after, self.before = np.roll(self.middle, -1), np.roll(self.middle, 1)
        centre = np.zeros(rows)
        path, _ = path_of(track, centre)
        tangent_x, tangent_y = self._thin(track.table[:, TANGENT_X]), self._thin(track.table[:, TANGENT_Y])
        unit = np.hypot(tangent_x, tangent_y)
        self.road = _Road(
            track.length / count,
            self._thin(track.table[:, X]),
            self._thin(track.table[:, Y]),
            -tangent_y / unit,
            tangent_x / unit,
            -self._thin(right),
            self._thin(left),
            self._thin(path.climb),
            self._thin(path.camber),
            self._thin(path.heave),
        )
        self.offset = np.clip(np.zeros(count), self.road.low + 0.05, self.road.high - 0.05)
        self.energy = 0.9 * self._thin(profile(track, centre, limits, START_GRIP * grip).speed) ** 2

    def _thin(self, values: Line) -> Line:
        """Values of the rows of the track table at the points."""
        return np.interp(self.at, np.arange(self.rows + 1), np.append(values, values[0]))

    def line(self) -> Line:
        """The offsets at the rows of the track table."""
        smooth = scipy.interpolate.CubicSpline(
            np.append(self.at, self.rows), np.append(self.offset, self.offset[0]), bc_type="periodic"
        )
        offsets: Line = smooth(np.arange(self.rows))
        return offsets

    def _shape(self, offset: Line) -> _Shape:
        road = self.road
        derivatives = []
        for values in (road.x + road.normal_x * offset, road.y + road.normal_y * offset):
            after, before = values[self.after], values[self.before]
            derivatives += [(after - before) / (2 * road.spacing)]
            derivatives += [(after - 2 * values + before) / road.spacing**2]
        x1, x2, y1, y2 = derivatives
        stretch = np.hypot(x1, y1)
        return _Shape(x1, y1, x2, y2, stretch, (x1 * y2 - y1 * x2) / stretch**3)

    def _car(self, energy: Line, curvature: Line) -> _Car:
        road, limits = self.road, self.limits
        speed = np.sqrt(energy)
        steep = 1.0 + road.climb**2 + road.camber**2
        lift = np.maximum(GRAVITY + road.heave * energy, 0.5)
        weight = lift / np.sqrt(steep)
        lean = np.sqrt(1.0 + road.camber**2) / _look_up(limits.corner, speed, weight)
        return _Car(
            lean * energy,
            lean * (curvature * energy + lift / steep * road.camber),
            np.interp(speed, SPEEDS, limits.drag) + lift / steep * road.climb,
            # The last point, where tyres are at their limit, is too steep to speak for the others.
            _look_up(limits.scrub[:, :, -5], speed, weight) / USED[-5] ** 2,
            _look_up(limits.traction[:, :, 0], speed, weight),
            _look_up(limits.brake[:, :, 0], speed, weight),
            np.interp(speed, SPEEDS, limits.power),
        )

    def _push(self, energy: Line, stretch: Line, car: _Car) -> tuple[Line, Line]:
        """Longitudinal acceleration by the tyres, m/s^2, and that of the whole car."""
        gain = (energy[self.after] - energy) / (2 * stretch * self.road.spacing)
        return gain + car.resistance + car.scrub * car.used**2, gain

    def cost(self, offset: Line, energy: Line, barrier: float) -> float:
        """Lap time, s, with what the limits cost; infinite beyond them."""
        road = self.road
        if (offset <= road.low).any() or (offset >= road.high).any() or (energy <= LEAST_ENERGY).any():
            return np.inf
        shape = self._shape(offset)
        car = self._car(energy, shape.curvature)
        push, _ = self._push(energy, shape.stretch, car)
        share = push / np.where(push > 0, car.traction, car.brake)
        spare, reserve = self.grip**2 - car.used**2 - share**2, car.power - push
        if (spare <= 0).any() or (reserve <= 0).any():
            return np.inf
        change = shape.curvature[self.after] - shape.curvature
        held = np.log(np.concatenate([spare, reserve, offset - road.low, road.high - offset]))
        time = np.sum(shape.stretch * road.spacing / np.sqrt(energy))
        return float(time + SMOOTHNESS / road.spacing * (change @ change) - barrier * held.sum())

    def _matrix(self, *entries: _Entries) -> scipy.sparse.csr_array:
        """A sparse (points, 2 points) matrix from columns and values; offsets are even, energies odd."""
        columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
        rows = np.tile(self.middle, len(entries))
        size = len(self.middle)
        return scipy.sparse.coo_array((values, (rows, columns)), shape=(size, 2 * size)).tocsr()

    def newton(self, barrier: float) -> tuple[Line, Line, float]:
        """Newton's step of offsets and energies, and how much the cost would fall by it, about twice."""
        road, energy, offset = self.road, self.energy, self.offset
        shape = self._shape(offset)
        stretch, curvature, step = shape.stretch, shape.curvature, road.spacing
        first = shape.x1 / stretch, shape.y1 / stretch
        stretching: list[_Entries] = []
        bending: list[_Entries] = []
        turning: list[_Entries] = []
        for place, slope, bend in (
            (self.after, 0.5 / step, 1 / step**2),
            (self.before, -0.5 / step, 1 / step**2),
            (self.middle, 0.0, -2 / step**2),
        ):
            nx, ny = road.normal_x[place], road.normal_y[place]
            by_stretch = slope * (first[0] * nx + first[1] * ny)
            turn = slope * (nx * shape.y2 - ny * shape.x2) + bend * (shape.x1 * ny - shape.y1 * nx)
            stretching.append((2 * place, by_stretch))
            bending.append((2 * place, turn / stretch**3 - 3 * curvature * by_stretch / stretch))
            turning.append((2 * place, slope * (first[0] * ny - first[1] * nx)))
        by_stretch, by_curvature = self._matrix(*stretching), self._matrix(*bending)
        sideways = self._matrix(*turning)
        small = 1e-5 * energy
        car, faster = self._car(energy, curvature), self._car(energy + small, curvature)
        by_energy = _Car._make((more - less) / small for more, less in zip(faster, car, strict=True))
        push, gain = self._push(energy, stretch, car)
        limit = np.where(push > 0, car.traction, car.brake)
        limit_by_energy = np.where(push > 0, by_energy.traction, by_energy.brake)

        def on_energy(values: Line) -> scipy.sparse.csr_array:
            return self._matrix((2 * self.middle + 1, values))

        used = scipy.sparse.diags_array(car.by_curvature) @ by_curvature + on_energy(by_energy.used)
        own = by_energy.resistance + by_energy.scrub * car.used**2 - 0.5 / (stretch * step)
        pushed = (
            on_energy(own)
            + self._matrix((2 * self.after + 1, 0.5 / (stretch * step)))
            + scipy.sparse.diags_array(2 * car.scrub * car.used) @ used
            - scipy.sparse.diags_array(gain / stretch) @ by_stretch
        )
        share = push / limit
        shared = scipy.sparse.diags_array(1 / limit) @ pushed - on_energy(share / limit * limit_by_energy)
        spare, reserve = self.grip**2 - car.used**2 - share**2, car.power - push
        spared = -2 * (scipy.sparse.diags_array(car.used) @ used + scipy.sparse.diags_array(share) @ shared)
        reserved = on_energy(by_energy.power) - pushed
        changed = by_curvature[self.after] - by_curvature
        change = curvature[self.after] - curvature
        to_low, to_high = offset - road.low, road.high - offset
        smooth = 2 * SMOOTHNESS / step

        gradient = by_stretch.T @ (step / np.sqrt(energy)) + smooth * (changed.T @ change)
        gradient -= barrier * (spared.T @ (1 / spare) + reserved.T @ (1 / reserve))
        gradient[1::2] -= 0.5 * stretch * step * energy**-1.5
        gradient[::2] += barrier * (1 / to_high - 1 / to_low)
        diagonal = np.empty(2 * len(offset))
        diagonal[::2] = barrier * (1 / to_low**2 + 1 / to_high**2)
        diagonal[1::2] = 0.75 * stretch * step * energy**-2.5
        hessian = scipy.sparse.diags_array(diagonal) + smooth * (changed.T @ changed)
        for weight, matrix in (
            (step / np.sqrt(energy) / stretch, sideways),
            (barrier / spare**2, spared),
            (barrier / reserve**2, reserved),
            (2 * barrier / spare, used),
            (2 * barrier / spare, shared),
        ):
            hessian = hessian + matrix.T @ scipy.sparse.diags_array(weight) @ matrix
        try:
            move = scipy.sparse.linalg.splu(hessian.tocsc()).solve(-gradient)
        except RuntimeError:  # it is singular, or not of numbers
            raise NoLine from None
        return move[::2], move[1::2], -float(gradient @ move)

    def lower(self, barrier: float) -> None:
        """Move to about the best line at a height of the barrier.

        Raises:
            NoLine: if the car holds the road at no speed.
        """
        while not np.isfinite(self.cost(self.offset, self.energy, barrier)):
            self.energy *= 0.9
            if not (self.energy > LEAST_ENERGY).all():
                raise NoLine
        for _ in range(STEPS):
            aside, faster, fall = self.newton(barrier)
            now = self.cost(self.offset, self.energy, barrier)
            part = 1.0
            while self.cost(self.offset + part * aside, self.energy + part * faster, barrier) > (
                now - 1e-4 * part * fall
            ):
                part *= 0.5
                if part < 1e-5:
                    return
            self.offset = self.offset + part * aside
            self.energy = self.energy + part * faster
            if fall < 0.05 * barrier * len(self.offset):
                return


def minimum_time(track: Track, limits: Envelope, grip: float) -> Line:
    """Lateral offsets (rows of the track table,) of the line of least quasi-steady lap time, m, + is left.

    What the road's height asks of the car is taken from the centre line.

    Args:
        track: the circuit.
        limits: of the car.
        grip: share of the tyres' grip to use.

    Raises:
        NoLine: if the car cannot drive the circuit.
    """
    left, right = room(track)
    for _ in range(1 + CORRECTIONS):
        search = _Search(track, limits, grip, left, right)
        barrier = FIRST_BARRIER
        while barrier > LAST_BARRIER:
            search.lower(barrier)
            barrier *= LOWERING
        offset = search.line()
        on_the_left, on_the_right = lacking(track, offset)
        if not (on_the_left.any() or on_the_right.any()):
            break
        left, right = less(track, left, on_the_left), less(track, right, on_the_right)
    return offset
