"""The four wheels of a car over one dynamics step, side by side in vectors: slips, forces, spins.

Wheel spin is far stiffer than the rest (some 500/s at 20 m/s), so it is advanced by a linearly implicit
step, together for the two wheels of an axle, which a differential couples.

Where the wheels of an axle are not treated alike to the last bit, it is because loops over them were not
before there were vectors, and races driven then are to be driven again.
"""

from __future__ import annotations

from nathlon.sim.car import CarParameters
from nathlon.sim.kernel import fused, lean_inlined
from nathlon.sim.physics.body import small_sin_cos
from nathlon.sim.physics.tyre import GONE, Four, Ground, broadcast, maximum, minimum, tyre_force
from nathlon.sim.simd import (
    absolute,
    add,
    copysign,
    divide,
    fma,
    greater,
    load,
    logical_or,
    multiply,
    negate,
    select,
    sqrt,
    store,
    subtract,
)
from nathlon.sim.state import CarRecord

SLOWEST = 6.0  # m/s: slips are formed with at least this speed, which keeps a car at rest well behaved
ROLLING_SPEED = 0.5  # m/s over which rolling resistance builds up
LOCKED = 1e-3  # rad/s below which a brake holds a wheel
LEFT = (True, False, True, False)


@lean_inlined
def by_axle(front: float, rear: float) -> Four:
    """A number for the front wheels and one for the rear wheels."""
    return front, front, rear, rear


@lean_inlined
def beside(numbers: Four) -> Four:
    """What belongs to the other wheel of the axle."""
    return numbers[1], numbers[0], numbers[3], numbers[2]


@lean_inlined
def within(force: Four, most_squared: Four, most: Four) -> Four:
    """Forces cut to the largest ones, which are given with their squares."""
    return select(greater(multiply(force, force), most_squared), copysign(most, force), force)


@lean_inlined
def less_pull(torque: Four, pull: Four, radius: float) -> Four:
    """Torque less that of a tyre's pull; the product is rounded on the right and not on the left."""
    return select(
        LEFT, fma(negate(broadcast(radius)), pull, torque), subtract(torque, multiply(radius, pull))
    )


@lean_inlined
def brake_torque(spin: Four, limit: Four, rest: Four) -> Four:
    """Torque of brakes that can apply `limit` N m: against the spin, or holding a locked wheel."""
    holding = negate(minimum(maximum(rest, negate(limit)), limit))
    return select(greater(absolute(spin), LOCKED), copysign(limit, negate(spin)), holding)


@lean_inlined
def solve_axles(torque: Four, own: Four, twist: Four, coupling: Four, dt: float) -> Four:
    """Changes of spin of wheels that differentials couple: two implicit equations at once for each axle.

    Args:
        torque: on each wheel, N m.
        own: inertia with the tyre's resistance, kg m^2.
        twist: impulse that the differential takes from the wheel as it spins now, N m s.
        coupling: what the differential adds to the inertia of each wheel of the axle, kg m^2.
        dt: s.
    """
    impulse = fma(torque, dt, negate(twist))
    own = add(own, coupling)
    determinant = fma(own, beside(own), negate(multiply(coupling, coupling)))
    left = fma(impulse, beside(own), multiply(coupling, beside(impulse)))
    right = fma(coupling, beside(impulse), multiply(beside(own), impulse))
    return multiply(select(LEFT, left, right), divide(1.0, determinant))


@lean_inlined
def controlled(
    change: Four,
    spin: Four,
    along: Four,
    brake: Four,
    drive: Four,
    own: Four,
    dt: float,
    p: CarParameters,
    peak: float,
) -> Four:
    """Changes of spin under slip control, which eases the torque that would exceed its slip.

    Args:
        change: without control, rad/s.
        spin: before, rad/s.
        along: velocity of the contact point after the step, m/s.
        brake, drive: torques that the control can ease, N m.
        own: inertia with the tyre's resistance, kg m^2.
        dt: s.
        peak: multiple of the slip at which the force peaks: slip control goes with it.
    """
    braking, driving = greater(brake, 0.0), greater(drive, 0.0)
    slip = select(braking, broadcast(-p.abs_slip * peak), broadcast(p.traction_slip * peak))
    limit = fma(fma(slip, maximum(absolute(along), broadcast(SLOWEST)), along), 1.0 / p.radius, negate(spin))
    eased = add(change, divide(multiply(select(braking, brake, negate(drive)), dt), own))
    slowing = select(greater(change, limit), change, minimum(limit, eased))
    pulling = select(greater(limit, change), change, maximum(limit, eased))
    change = select(braking, slowing, select(driving, pulling, change))
    # A brake stops a wheel, it does not turn it the other way.
    turned = greater(0.0, multiply(add(spin, change), spin))
    return select(braking, select(turned, negate(spin), change), change)


@lean_inlined
def step_wheels(
    car: CarRecord,
    loads: Four,
    torque: float,
    engine_inertia: float,
    ground: Ground,
    dt: float,
    p: CarParameters,
    wear_rate: float,
    peak: float,
) -> tuple[float, float, float]:
    """Advance the spins and sum the tyre forces.

    Args:
        car: CAR_STATE record; spins, slips and wear are set.
        loads: of the tyres, N.
        torque: that drives the axles, N m.
        engine_inertia: as the axles feel it, kg m^2.
        ground: under the tyres.
        dt: s.
        p: the car's parameters.
        wear_rate: see `Rates`.
        peak: multiple of the slip at which the force peaks.

    Returns:
        forces (N) and moment (N m) on the car in its frame.
    """
    u, v, r = car.velocity_x, car.velocity_y, car.yaw_rate
    sine, cosine = small_sin_cos(car.steering)
    sines, cosines = by_axle(sine, 0.0), by_axle(cosine, 1.0)
    wide = by_axle(p.half_front_track, p.half_rear_track)
    side = multiply(r, wide)
    point_x = add(u, select(LEFT, negate(side), side))
    point_y = fma(by_axle(p.a, -p.b), r, broadcast(v))
    along = fma(cosines, point_x, multiply(sines, point_y))
    across = fma(negate(sines), point_x, multiply(cosines, point_y))
    # The last step's acceleration foretells the road speed, but would set a car at rest swinging.
    gain_speed = multiply(cosines, dt * fused(v, r, car.acceleration_x))
    after = add(along, select(greater(absolute(broadcast(u)), SLOWEST), gain_speed, broadcast(0.0)))

    share = by_axle(p.drive_front, 1.0 - p.drive_front)
    inertia = fma(share, 0.5 * engine_inertia, broadcast(p.wheel_inertia))
    drive = multiply(share, 0.5 * torque)
    brake = by_axle(car.brake * p.brake_torque_front, car.brake * p.brake_torque_rear)
    coupling = select(greater(share, 0.0), broadcast(dt * p.differential), broadcast(0.0))

    spin = load(car.spin, 0)
    rolling = multiply(spin, p.radius)
    sliding = subtract(rolling, along)
    per_reference = divide(1.0, maximum(absolute(along), broadcast(SLOWEST)))
    slip_ratio = multiply(sliding, per_reference)
    slip_angle = multiply(negate(across), per_reference)
    store(car.slip_ratio, 0, slip_ratio)
    store(car.slip_angle, 0, slip_angle)
    # Exact where the peak is the car's own: races on dry road stay what they were.
    nearer = 1.0 / peak
    _, fy, stiffness, most_squared = tyre_force(
        multiply(slip_ratio, nearer), multiply(slip_angle, nearer), loads, load(ground.grip, 0), p
    )
    stiffness = multiply(stiffness, nearer)
    most = sqrt(most_squared)
    per_speed = divide(stiffness, maximum(absolute(after), broadcast(SLOWEST)))
    gain = multiply(per_speed, p.radius)
    fx = within(multiply(per_speed, subtract(rolling, after)), most_squared, most)
    applied = add(drive, brake_torque(spin, brake, less_pull(drive, fx, p.radius)))

    twist = multiply(coupling, subtract(spin, beside(spin)))
    own = fma(dt * p.radius, gain, inertia)
    change = solve_axles(less_pull(applied, fx, p.radius), own, twist, coupling, dt)
    # The secant overshoots the peak: a saturated tyre pulls with its friction, whatever the spin.
    pull = fma(gain, change, fx)
    beyond = greater(multiply(pull, pull), most_squared)
    held = select(beyond, copysign(most, pull), fx)
    held_own = select(beyond, inertia, own)
    again = solve_axles(fma(-p.radius, held, applied), held_own, twist, coupling, dt)
    held_axle = logical_or(beyond, beside(beyond))
    change, own = select(held_axle, again, change), select(held_axle, held_own, own)
    change = controlled(change, spin, after, brake, drive, own, dt, p, peak)

    pull = within(fma(gain, change, fx), most_squared, most)
    store(car.spin, 0, add(spin, change))
    if wear_rate > 0.0:
        slide = add(absolute(multiply(pull, sliding)), absolute(multiply(fy, across)))
        worn = fma(wear_rate * p.wear_per_joule * dt, slide, load(car.wear, 0))
        store(car.wear, 0, minimum(worn, broadcast(GONE)))
    rolled = multiply(multiply(load(ground.drag, 0), loads), along)
    pull = subtract(pull, divide(rolled, add(absolute(along), ROLLING_SPEED)))
    x = fma(cosines, pull, multiply(negate(sines), fy))
    y = fma(cosines, fy, multiply(sines, pull))
    front_x, front_y, rear_x, rear_y = x[0] + x[1], y[0] + y[1], x[2] + x[3], y[2] + y[3]
    front_turn = fused(p.a, front_y, p.half_front_track * (x[1] - x[0]))
    rear_turn = fused(p.half_rear_track, x[3] - x[2], -(p.b * rear_y))
    return front_x + rear_x, front_y + rear_y, front_turn + rear_turn
