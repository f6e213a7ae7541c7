"""Where a car is on its circuit, and what the circuit does to it: slopes, surfaces, walls."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from nathlon.sim.car import CarParameters
from nathlon.sim.data_file import Section
from nathlon.sim.kernel import fused, lean_inlined
from nathlon.sim.physics.contact import hit_wall
from nathlon.sim.physics.tyre import Ground, broadcast, worn_grip
from nathlon.sim.simd import multiply, store
from nathlon.sim.state import CarRecord
from nathlon.sim.track import (
    BANK,
    CREST,
    CURVATURE,
    KERB_LEFT,
    KERB_RIGHT,
    LEFT,
    LEVEL,
    RIGHT,
    RUNOFF_LEFT,
    RUNOFF_RIGHT,
    SLOPE,
    SURFACES,
    TANGENT_X,
    TANGENT_Y,
    TWIST,
    WALL_LEFT,
    WALL_RIGHT,
    Track,
    X,
    Y,
    Z,
)

# In the order of nathlon.sim.track.SURFACES.
SURFACE_GRIP = np.array([1.0, 0.92, 0.55, 0.48])
SURFACE_DRAG = np.array([0.0, 0.004, 0.065, 0.22])
"""Rolling resistance beyond that of the tyre on the road."""
KERB = 1
KERB_PITCH = 2.3  # m from rib to rib, as the tyres feel them
KERB_SHAKE = 0.2  # share of the load that comes and goes on a kerb


GRIP = (0.05, 1.5)
"""From wet ice to a road that grips better than usual."""
Multiple = Annotated[float, Field(ge=GRIP[0], le=GRIP[1])]


class SurfaceGrip(Section):
    """Grip of each surface as a multiple of its own when dry."""

    tarmac: Multiple = 1.0
    kerb: Multiple = 1.0
    grass: Multiple = 1.0
    gravel: Multiple = 1.0


DRY = SurfaceGrip()


class CourseParameters(NamedTuple):
    """What the kernels read of a track and of its conditions.

    `surface_grip` is (4,), the grip of each surface over that of the road.
    """

    table: NDArray[np.float64]
    edges: NDArray[np.float32]
    sectors: NDArray[np.float64]
    spacing: float
    length: float
    surface_grip: NDArray[np.float64]


def course_parameters(track: Track, grip: SurfaceGrip = DRY) -> CourseParameters:
    """The kernels' view of a track in some conditions."""
    multiples = np.array([getattr(grip, surface) for surface in SURFACES])
    surface_grip = SURFACE_GRIP * (multiples / grip.tarmac)
    sectors = np.array(track.sectors)
    return CourseParameters(track.table, track.edges, sectors, track.spacing, track.length, surface_grip)


@lean_inlined
def project(car: CarRecord, line: np.ndarray) -> tuple[float, float, float]:
    """Where a car lies seen from a row of the table.

    Returns:
        m ahead along the tangent, m aside (+ is left), and m along the centre line, which is taken as
        a circular arc from row to row.
    """
    dx, dy = car.x - line[X], car.y - line[Y]
    ahead = dx * line[TANGENT_X] + dy * line[TANGENT_Y]
    aside = dy * line[TANGENT_X] - dx * line[TANGENT_Y]
    return ahead, aside, ahead / max(1.0 - line[CURVATURE] * aside, 0.2)


@lean_inlined
def locate(car: CarRecord, course: CourseParameters) -> None:
    """Follow the car along the centre line from where it was last found."""
    rows = len(course.table)
    went_back = False
    ahead = aside = along = 0.0
    for _ in range(rows):
        ahead, aside, along = project(car, course.table[car.row])
        if along >= course.spacing and not went_back:
            car.row += 1
            if car.row == rows:
                car.row = 0
                car.wraps += 1
        elif along < -1e-9:
            went_back = True
            car.row -= 1
            if car.row < 0:
                car.row = rows - 1
                car.wraps -= 1
        else:
            break
    # Rounding must not send the search to and fro between two rows.
    car.along = min(max(along, 0.0), course.spacing)
    car.lateral = aside - 0.5 * course.table[car.row, CURVATURE] * ahead * along
    car.progress = fused(float(car.row), course.spacing, car.wraps * course.length) + car.along


@lean_inlined
def on_other_level(a: CarRecord, b: CarRecord, course: CourseParameters) -> bool:
    """Whether one of two cars is on a bridge or its ramps, and the other on the road below."""
    level = course.table[a.row, LEVEL]
    return level != 0.0 and course.table[b.row, LEVEL] == -level


@lean_inlined
def facing(car: CarRecord, course: CourseParameters) -> tuple[float, float]:
    """Sine and cosine of the heading error of a located car.

    The turn of the centre line between two rows, at most some 0.1 rad, is taken as a small angle.
    """
    line = course.table[car.row]
    turn = line[CURVATURE] * car.along
    sine = car.sin_yaw * line[TANGENT_X] - car.cos_yaw * line[TANGENT_Y]
    cosine = car.cos_yaw * line[TANGENT_X] + car.sin_yaw * line[TANGENT_Y]
    level = 1.0 - 0.5 * turn * turn
    return sine * level - cosine * turn, cosine * level + sine * turn


@lean_inlined
def set_heading_error(car: CarRecord, course: CourseParameters) -> None:
    """Yaw of a located car minus the direction of the centre line beside it, rad in [-pi, pi]."""
    sine, cosine = facing(car, course)
    car.heading_error = math.atan2(sine, cosine)


@lean_inlined
def feel_road(car: CarRecord, sine: float, cosine: float, course: CourseParameters) -> None:
    """Set height, gradient and heave of the road under a located car.

    The surface is z(s, n) = z(s) + bank(s) n. `heave` is the second derivative of the height along
    the straight line on which the car moves.

    Args:
        sine, cosine: of the heading error.
    """
    line = course.table[car.row]
    slope = line[SLOPE] + line[CREST] * car.along
    bank = line[BANK] + line[TWIST] * car.along
    car.z = line[Z] + (line[SLOPE] + 0.5 * line[CREST] * car.along) * car.along + bank * car.lateral
    stretch = 1.0 / max(1.0 - line[CURVATURE] * car.lateral, 0.2)
    rise = slope + line[TWIST] * car.lateral
    climb = rise * stretch
    car.slope_x = climb * cosine + bank * sine
    car.slope_y = bank * cosine - climb * sine
    forward = car.velocity_x * cosine - car.velocity_y * sine
    aside = car.velocity_x * sine + car.velocity_y * cosine
    advance = forward * stretch
    car.heave = advance * (
        line[CREST] * advance
        + 2.0 * line[TWIST] * aside
        + line[CURVATURE] * (2.0 * climb * aside - bank * forward)
    )


@lean_inlined
def stand_on(
    car: CarRecord,
    sine: float,
    cosine: float,
    worn: bool,
    ground: Ground,
    p: CarParameters,
    course: CourseParameters,
) -> int:
    """Set what is under each tyre.

    Args:
        sine, cosine: of the heading error.
        worn: whether tyres wear or get wet at all.
        ground: set.

    Returns:
        the number of tyres out of bounds.
    """
    line = course.table[car.row]
    wear = car.wear
    if worn:
        left = (worn_grip(wear[0]), worn_grip(wear[1]), worn_grip(wear[2]), worn_grip(wear[3]))
        store(ground.grip, 0, multiply(left, car.tyre_grip * car.wet_grip))
    else:
        store(ground.grip, 0, broadcast(1.0))
    store(ground.drag, 0, broadcast(p.rolling_resistance))
    store(ground.shake, 0, broadcast(1.0))
    reach = p.a * abs(sine) + p.half_front_track * abs(cosine) + 2.0 * abs(line[CURVATURE])
    if car.lateral + reach < line[LEFT] and car.lateral - reach > -line[RIGHT]:
        return 0
    out = 0
    for wheel in range(4):
        x = p.a if wheel < 2 else -p.b
        y = p.half_front_track if wheel < 2 else p.half_rear_track
        if wheel % 2 == 1:
            y = -y
        ahead = x * cosine - y * sine
        lateral = car.lateral + x * sine + y * cosine - 0.5 * line[CURVATURE] * ahead * ahead
        if lateral > 0.0:
            beyond, kerb, runoff = lateral - line[LEFT], line[KERB_LEFT], line[RUNOFF_LEFT]
        else:
            beyond, kerb, runoff = -lateral - line[RIGHT], line[KERB_RIGHT], line[RUNOFF_RIGHT]
        if beyond <= 0.0:
            continue
        surface = KERB
        if beyond > kerb:
            out += 1
            surface = int(runoff)
        else:
            rib = (car.progress + x) / KERB_PITCH
            ground.shake[wheel] += KERB_SHAKE * (4.0 * abs(rib - math.floor(rib) - 0.5) - 1.0)
        ground.grip[wheel] *= course.surface_grip[surface]
        ground.drag[wheel] += SURFACE_DRAG[surface]
    return out


@lean_inlined
def meet_walls(
    car: CarRecord, sine: float, cosine: float, p: CarParameters, course: CourseParameters
) -> bool:
    """Resolve the contact of the car's deepest corner with a wall, if there is one.

    Args:
        sine, cosine: of the heading error.
    """
    line = course.table[car.row]
    reach = p.half_length * abs(sine) + p.half_width * abs(cosine) + 4.0 * abs(line[CURVATURE])
    if car.lateral + reach < line[WALL_LEFT] and car.lateral - reach > -line[WALL_RIGHT]:
        return False
    depth = 0.0
    side = deepest_x = deepest_y = 0.0
    for corner in range(4):
        x = p.half_length if corner < 2 else -p.half_length
        y = p.half_width if corner % 2 == 0 else -p.half_width
        ahead = x * cosine - y * sine
        lateral = car.lateral + x * sine + y * cosine - 0.5 * line[CURVATURE] * ahead * ahead
        beyond_left = lateral - line[WALL_LEFT]
        beyond_right = -line[WALL_RIGHT] - lateral
        if beyond_left > depth:
            depth, side, deepest_x, deepest_y = beyond_left, -1.0, x, y
        if beyond_right > depth:
            depth, side, deepest_x, deepest_y = beyond_right, 1.0, x, y
    if side == 0.0:
        return False
    arm_x = deepest_x * car.cos_yaw - deepest_y * car.sin_yaw
    arm_y = deepest_x * car.sin_yaw + deepest_y * car.cos_yaw
    turn = line[CURVATURE] * car.along
    normal_x = -line[TANGENT_Y] - line[TANGENT_X] * turn
    normal_y = line[TANGENT_X] - line[TANGENT_Y] * turn
    scale = side / math.sqrt(normal_x * normal_x + normal_y * normal_y)
    hit_wall(car, arm_x, arm_y, scale * normal_x, scale * normal_y, depth, p)
    return True
