"""Contact: oriented boxes against each other and against walls, by impulse with friction.

Impulses are taken one after the other, first along the normal and then along the contact, each from
the velocity that the last one left: so none of them can add energy.
"""

from __future__ import annotations

from typing import NamedTuple

from nathlon.sim.car import CarParameters
from nathlon.sim.kernel import lean_inlined
from nathlon.sim.physics.body import mobility, point_velocity, push, set_body_velocity
from nathlon.sim.state import CarRecord

CAR_RESTITUTION = 0.15
CAR_FRICTION = 0.35
WALL_RESTITUTION = 0.1
WALL_FRICTION = 0.4
RESTING = 1.0
"""m/s: what meets more slowly does not bounce, so that a pile comes to rest."""


class Touch(NamedTuple):
    """How two cars touch.

    Attributes:
        closing: speed at the point of contact along the normal, m/s; 0 if they part, -1.0 where the
            boxes do not overlap.
        x, y: the point, world frame, m.
        normal_x, normal_y: unit vector from the first car to the second, world frame.
    """

    closing: float
    x: float
    y: float
    normal_x: float
    normal_y: float


@lean_inlined
def reach_on(
    axis_x: float, axis_y: float, a: CarRecord, b: CarRecord, of_a: CarParameters, of_b: CarParameters
) -> float:
    """Distance (m) of two cars' centres along a unit axis below which their boxes overlap on it."""
    reach = 0.0
    for cos_yaw, sin_yaw, half_length, half_width in (
        (a.cos_yaw, a.sin_yaw, of_a.half_length, of_a.half_width),
        (b.cos_yaw, b.sin_yaw, of_b.half_length, of_b.half_width),
    ):
        along = cos_yaw * axis_x + sin_yaw * axis_y
        across = cos_yaw * axis_y - sin_yaw * axis_x
        reach += half_length * abs(along) + half_width * abs(across)
    return reach


@lean_inlined
def corners_inside(
    a: CarRecord, b: CarRecord, of_a: CarParameters, of_b: CarParameters
) -> tuple[float, float, int]:
    """Sum of the world positions of a's corners that lie in b's box, and their number."""
    sum_x = sum_y = 0.0
    count = 0
    for corner in range(4):
        x = of_a.half_length if corner < 2 else -of_a.half_length
        y = of_a.half_width if corner % 2 == 0 else -of_a.half_width
        world_x = a.x + x * a.cos_yaw - y * a.sin_yaw
        world_y = a.y + x * a.sin_yaw + y * a.cos_yaw
        along = (world_x - b.x) * b.cos_yaw + (world_y - b.y) * b.sin_yaw
        across = (world_y - b.y) * b.cos_yaw - (world_x - b.x) * b.sin_yaw
        if abs(along) <= of_b.half_length and abs(across) <= of_b.half_width:
            sum_x += world_x
            sum_y += world_y
            count += 1
    return sum_x, sum_y, count


@lean_inlined
def collide(a: CarRecord, b: CarRecord, dt: float, of_a: CarParameters, of_b: CarParameters) -> Touch:
    """Resolve the contact of two cars, if there is one.

    The normal is that of the axis on which the boxes came together last, so that cars which met
    head-on within the last `dt` seconds are not taken for cars side by side, and points to the side
    from which they came, however far they have gone through each other since. Boxes that overlapped
    before are parted the shortest way.
    """
    apart = Touch(-1.0, 0.0, 0.0, 0.0, 0.0)
    dx, dy = b.x - a.x, b.y - a.y
    relative_x = b.world_velocity_x - a.world_velocity_x
    relative_y = b.world_velocity_y - a.world_velocity_y
    latest = -1.0
    depth = 1e9
    normal_x = normal_y = 0.0
    for side in range(4):
        car = a if side < 2 else b
        axis_x, axis_y = (car.cos_yaw, car.sin_yaw) if side % 2 == 0 else (-car.sin_yaw, car.cos_yaw)
        offset = dx * axis_x + dy * axis_y
        moved = (relative_x * axis_x + relative_y * axis_y) * dt
        reach = reach_on(axis_x, axis_y, a, b, of_a, of_b)
        if abs(offset) >= reach:
            return apart
        sign = 1.0 if offset >= moved else -1.0
        overlap, gained = reach - sign * offset, -sign * moved
        met = 1.0 - overlap / gained if gained > overlap else 0.0
        if met > latest or (met == latest and overlap < depth):
            latest, depth = met, overlap
            normal_x, normal_y = sign * axis_x, sign * axis_y

    ax, ay, in_b = corners_inside(a, b, of_a, of_b)
    bx, by, in_a = corners_inside(b, a, of_b, of_a)
    if in_a + in_b > 0:
        point_x, point_y = (ax + bx) / (in_a + in_b), (ay + by) / (in_a + in_b)
    else:
        point_x, point_y = 0.5 * (a.x + b.x), 0.5 * (a.y + b.y)

    closing = -bounce(a, b, point_x, point_y, normal_x, normal_y, of_a, of_b)
    share = b.mass / (a.mass + b.mass)
    a.x -= share * depth * normal_x
    a.y -= share * depth * normal_y
    b.x += (1.0 - share) * depth * normal_x
    b.y += (1.0 - share) * depth * normal_y
    return Touch(max(closing, 0.0), point_x, point_y, normal_x, normal_y)


@lean_inlined
def bounce(
    a: CarRecord,
    b: CarRecord,
    x: float,
    y: float,
    normal_x: float,
    normal_y: float,
    of_a: CarParameters,
    of_b: CarParameters,
) -> float:
    """Exchange impulses at a point between cars that close in on each other.

    Returns:
        the speed at which the cars parted at the point before, m/s.
    """
    arm_ax, arm_ay = x - a.x, y - a.y
    arm_bx, arm_by = x - b.x, y - b.y
    va_x, va_y = point_velocity(a, arm_ax, arm_ay)
    vb_x, vb_y = point_velocity(b, arm_bx, arm_by)
    parting = (vb_x - va_x) * normal_x + (vb_y - va_y) * normal_y
    if parting >= 0.0:
        return parting
    give = mobility(a, arm_ax, arm_ay, normal_x, normal_y, of_a)
    give += mobility(b, arm_bx, arm_by, normal_x, normal_y, of_b)
    restitution = CAR_RESTITUTION if parting < -RESTING else 0.0
    impulse = -(1.0 + restitution) * parting / give
    push(a, arm_ax, arm_ay, -impulse * normal_x, -impulse * normal_y, of_a)
    push(b, arm_bx, arm_by, impulse * normal_x, impulse * normal_y, of_b)

    tangent_x, tangent_y = -normal_y, normal_x
    va_x, va_y = point_velocity(a, arm_ax, arm_ay)
    vb_x, vb_y = point_velocity(b, arm_bx, arm_by)
    sliding = (vb_x - va_x) * tangent_x + (vb_y - va_y) * tangent_y
    give = mobility(a, arm_ax, arm_ay, tangent_x, tangent_y, of_a)
    give += mobility(b, arm_bx, arm_by, tangent_x, tangent_y, of_b)
    rub = min(max(-sliding / give, -CAR_FRICTION * impulse), CAR_FRICTION * impulse)
    push(a, arm_ax, arm_ay, -rub * tangent_x, -rub * tangent_y, of_a)
    push(b, arm_bx, arm_by, rub * tangent_x, rub * tangent_y, of_b)
    set_body_velocity(a)
    set_body_velocity(b)
    return parting


@lean_inlined
def hit_wall(
    car: CarRecord,
    arm_x: float,
    arm_y: float,
    normal_x: float,
    normal_y: float,
    depth: float,
    p: CarParameters,
) -> None:
    """Push a car off a wall that its corner is `depth` metres inside.

    Args:
        arm_x, arm_y: from the centre of mass to the corner, m, world frame.
        normal_x, normal_y: unit vector from the wall to the road, world frame.
    """
    car.x += depth * normal_x
    car.y += depth * normal_y
    point_x, point_y = point_velocity(car, arm_x, arm_y)
    parting = point_x * normal_x + point_y * normal_y
    if parting >= 0.0:
        return
    restitution = WALL_RESTITUTION if parting < -RESTING else 0.0
    impulse = -(1.0 + restitution) * parting / mobility(car, arm_x, arm_y, normal_x, normal_y, p)
    push(car, arm_x, arm_y, impulse * normal_x, impulse * normal_y, p)
    tangent_x, tangent_y = -normal_y, normal_x
    point_x, point_y = point_velocity(car, arm_x, arm_y)
    stop = -(point_x * tangent_x + point_y * tangent_y) / mobility(car, arm_x, arm_y, tangent_x, tangent_y, p)
    rub = min(max(stop, -WALL_FRICTION * impulse), WALL_FRICTION * impulse)
    push(car, arm_x, arm_y, rub * tangent_x, rub * tangent_y, p)
    set_body_velocity(car)
