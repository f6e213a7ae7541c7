"""Contact: oriented boxes against each other and against walls, by impulse with friction."""

from __future__ import annotations

from sim.car import CarParameters
from sim.kernel import inlined
from sim.physics.chassis import set_body_velocity
from sim.state import CarRecord

CAR_RESTITUTION = 0.15
CAR_FRICTION = 0.35
WALL_RESTITUTION = 0.1
WALL_FRICTION = 0.4


@inlined
def push(
    car: CarRecord, arm_x: float, arm_y: float, impulse_x: float, impulse_y: float, p: CarParameters
) -> None:
    """Apply an impulse (N s, world frame) at an arm (m, world frame) from the centre of mass."""
    car.world_velocity_x += impulse_x / p.mass
    car.world_velocity_y += impulse_y / p.mass
    car.yaw_rate += (arm_x * impulse_y - arm_y * impulse_x) / p.yaw_inertia


@inlined
def overlap_on(
    axis_x: float, axis_y: float, dx: float, dy: float, a: CarRecord, b: CarRecord, p: CarParameters
) -> float:
    """Overlap (m) of two cars' boxes projected on a unit axis; negative where they are apart."""
    reach = 0.0
    for cos_yaw, sin_yaw in ((a.cos_yaw, a.sin_yaw), (b.cos_yaw, b.sin_yaw)):
        along = cos_yaw * axis_x + sin_yaw * axis_y
        across = cos_yaw * axis_y - sin_yaw * axis_x
        reach += p.half_length * abs(along) + p.half_width * abs(across)
    return reach - abs(dx * axis_x + dy * axis_y)


@inlined
def corners_inside(a: CarRecord, b: CarRecord, p: CarParameters) -> tuple[float, float, int]:
    """Sum of the world positions of a's corners that lie in b's box, and their number."""
    sum_x = sum_y = 0.0
    count = 0
    for corner in range(4):
        x = p.half_length if corner < 2 else -p.half_length
        y = p.half_width if corner % 2 == 0 else -p.half_width
        world_x = a.x + x * a.cos_yaw - y * a.sin_yaw
        world_y = a.y + x * a.sin_yaw + y * a.cos_yaw
        along = (world_x - b.x) * b.cos_yaw + (world_y - b.y) * b.sin_yaw
        across = (world_y - b.y) * b.cos_yaw - (world_x - b.x) * b.sin_yaw
        if abs(along) <= p.half_length and abs(across) <= p.half_width:
            sum_x += world_x
            sum_y += world_y
            count += 1
    return sum_x, sum_y, count


@inlined
def collide(a: CarRecord, b: CarRecord, p: CarParameters) -> float:
    """Resolve the contact of two cars, if there is one.

    Returns:
        the closing speed at the point of contact, m/s (0 if they touch while parting), or -1.0
        where the boxes do not overlap.
    """
    dx, dy = b.x - a.x, b.y - a.y
    if dx * dx + dy * dy > 4.0 * (p.half_length * p.half_length + p.half_width * p.half_width):
        return -1.0

    depth = 1e9
    normal_x = normal_y = 0.0
    for side in range(4):
        car = a if side < 2 else b
        axis_x, axis_y = (car.cos_yaw, car.sin_yaw) if side % 2 == 0 else (-car.sin_yaw, car.cos_yaw)
        overlap = overlap_on(axis_x, axis_y, dx, dy, a, b, p)
        if overlap <= 0.0:
            return -1.0
        if overlap < depth:
            depth = overlap
            sign = 1.0 if dx * axis_x + dy * axis_y >= 0.0 else -1.0
            normal_x, normal_y = sign * axis_x, sign * axis_y

    ax, ay, in_b = corners_inside(a, b, p)
    bx, by, in_a = corners_inside(b, a, p)
    if in_a + in_b > 0:
        point_x, point_y = (ax + bx) / (in_a + in_b), (ay + by) / (in_a + in_b)
    else:
        point_x, point_y = 0.5 * (a.x + b.x), 0.5 * (a.y + b.y)

    arm_ax, arm_ay = point_x - a.x, point_y - a.y
    arm_bx, arm_by = point_x - b.x, point_y - b.y
    relative_x = b.world_velocity_x - b.yaw_rate * arm_by - a.world_velocity_x + a.yaw_rate * arm_ay
    relative_y = b.world_velocity_y + b.yaw_rate * arm_bx - a.world_velocity_y - a.yaw_rate * arm_ax
    parting = relative_x * normal_x + relative_y * normal_y
    if parting < 0.0:
        turn_a = arm_ax * normal_y - arm_ay * normal_x
        turn_b = arm_bx * normal_y - arm_by * normal_x
        give = 2.0 / p.mass + (turn_a * turn_a + turn_b * turn_b) / p.yaw_inertia
        impulse = -(1.0 + CAR_RESTITUTION) * parting / give

        tangent_x, tangent_y = -normal_y, normal_x
        sliding = relative_x * tangent_x + relative_y * tangent_y
        turn_a = arm_ax * tangent_y - arm_ay * tangent_x
        turn_b = arm_bx * tangent_y - arm_by * tangent_x
        give = 2.0 / p.mass + (turn_a * turn_a + turn_b * turn_b) / p.yaw_inertia
        rub = min(max(-sliding / give, -CAR_FRICTION * impulse), CAR_FRICTION * impulse)

        impulse_x = impulse * normal_x + rub * tangent_x
        impulse_y = impulse * normal_y + rub * tangent_y
        push(a, arm_ax, arm_ay, -impulse_x, -impulse_y, p)
        push(b, arm_bx, arm_by, impulse_x, impulse_y, p)
        set_body_velocity(a)
        set_body_velocity(b)

    a.x -= 0.5 * depth * normal_x
    a.y -= 0.5 * depth * normal_y
    b.x += 0.5 * depth * normal_x
    b.y += 0.5 * depth * normal_y
    return max(-parting, 0.0)


@inlined
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
    point_x = car.world_velocity_x - car.yaw_rate * arm_y
    point_y = car.world_velocity_y + car.yaw_rate * arm_x
    parting = point_x * normal_x + point_y * normal_y
    if parting >= 0.0:
        return
    turn = arm_x * normal_y - arm_y * normal_x
    impulse = -(1.0 + WALL_RESTITUTION) * parting / (1.0 / p.mass + turn * turn / p.yaw_inertia)
    tangent_x, tangent_y = -normal_y, normal_x
    turn = arm_x * tangent_y - arm_y * tangent_x
    stop = -(point_x * tangent_x + point_y * tangent_y) / (1.0 / p.mass + turn * turn / p.yaw_inertia)
    rub = min(max(stop, -WALL_FRICTION * impulse), WALL_FRICTION * impulse)
    push(
        car,
        arm_x,
        arm_y,
        impulse * normal_x + rub * tangent_x,
        impulse * normal_y + rub * tangent_y,
        p,
    )
    set_body_velocity(car)
