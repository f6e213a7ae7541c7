"""The physics of one car against closed forms of the same parameters, written out here anew."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

from sim.car import Car, compound_ratio, load_car, parameters
from sim.kernel import kernel
from sim.physics.chassis import Rates, advance
from sim.physics.course import facing, feel_road, locate, stand_on
from sim.physics.draught import wake
from sim.physics.powertrain import engine_torque
from sim.physics.tyre import tyre_force, worn_grip
from sim.state import CAR_STATE
from sim.track import Track
from sim.world import DYNAMICS_DT, Conditions, World, locate_all
from tests.driving import GT3, STRAIGHT_M, circle, drive, road, stadium, world_with

G = 9.81
P = parameters(GT3)
CARS = {name: load_car(name) for name in ("gt3", "coupe", "prototype")}
PLANE = circle(2000.0, half_width=1500.0, wall=1600.0)
"""So wide that a car may turn circles on it."""

loads = st.floats(200.0, 10_000.0)
slip_ratios = st.floats(-2.0, 2.0)
slip_angles = st.floats(-1.5, 1.5)
each_car = pytest.mark.parametrize("car", CARS.values(), ids=CARS)


def changed(car: Car, section: str, **values: object) -> Car:
    """A car with some figures of one section replaced."""
    return car.model_copy(update={section: getattr(car, section).model_copy(update=values)})


def without_losses(car: Car) -> Car:
    """A car that nothing holds back: no air, no rolling resistance, weightless wheels, no engine drag."""
    car = changed(car, "aero", drag_area_m2=0.0, downforce_area_m2=0.0)
    car = changed(car, "wheel", rolling_resistance=0.0, inertia_kg_m2=1e-3)
    return changed(car, "engine", braking_torque_n_m=0.0, inertia_kg_m2=0.0)


FREE = without_losses(GT3)
FRONT_DRIVEN = changed(CARS["coupe"], "gearbox", front_share=1.0)


def at_load(car: Car, values: tuple[float, float], load: float) -> float:
    """A tyre's property, linear in the load through the two points of its file."""
    low, high = car.tyre.load_n
    return values[0] + (values[1] - values[0]) * (load - low) / (high - low)


def magic(car: Car, slip: float) -> float:
    """Share of the peak force at a slip normalised by that of the peak."""
    return math.sin(car.tyre.shape * math.atan(math.tan(math.pi / 2 / car.tyre.shape) * slip))


def pull(car: Car, slip: float, load: float) -> float:
    """Longitudinal force of a tyre that runs straight, N."""
    share = magic(car, slip / at_load(car, car.tyre.peak_slip_ratio, load))
    return share * at_load(car, car.tyre.friction_longitudinal, load) * load


def hold(car: Car, slip: float, load: float) -> float:
    """Lateral force of a tyre that rolls freely, N."""
    share = magic(car, slip / at_load(car, car.tyre.peak_slip_angle_rad, load))
    return share * at_load(car, car.tyre.friction_lateral, load) * load


def wheelbase(car: Car) -> float:
    return car.body.front_axle_m + car.body.rear_axle_m


def downforce(car: Car, speed: float) -> float:
    return 0.5 * 1.2 * car.aero.downforce_area_m2 * speed**2


def air_drag(car: Car, speed: float) -> float:
    return 0.5 * 1.2 * car.aero.drag_area_m2 * speed**2


def axle_loads(car: Car, speed: float, forward: float = 0.0) -> tuple[float, float]:
    """Loads of the axles, N, on the level, where the tyres push the car with `forward` m/s^2."""
    down, share = downforce(car, speed), car.aero.downforce_front_share
    pitch = car.body.mass_kg * forward * car.body.centre_of_mass_height_m / wheelbase(car)
    weight = car.body.mass_kg * G
    front = weight * car.body.rear_axle_m / wheelbase(car) + down * share - pitch
    return front, weight + down - front


def rolling(car: Car, speed: float) -> float:
    """Rolling resistance, N, which builds up over half a metre per second."""
    load = car.body.mass_kg * G + downforce(car, speed)
    return car.wheel.rolling_resistance * load * speed / (speed + 0.5)


def deceleration(car: Car, speed: float, grip: float = 1.0, drag: float = 0.0) -> float:
    """Braking with all tyres at the slip that the control holds, or with the force of their brakes.

    Args:
        car: without losses in its engine.
        speed: m/s.
        grip: of surface and tyres.
        drag: rolling resistance of the surface beyond the tyres'.
    """
    air = air_drag(car, speed)
    shares = car.brakes.front_share, 1 - car.brakes.front_share

    def excess(backward: float) -> float:
        force = air + rolling(car, speed) + drag * (car.body.mass_kg * G + downforce(car, speed))
        loads = axle_loads(car, speed, air / car.body.mass_kg - backward)
        for load, share in zip(loads, shares, strict=True):
            turning = 2 * car.wheel.inertia_kg_m2 * backward / car.wheel.radius_m**2
            brakes = car.brakes.torque_n_m * share / car.wheel.radius_m - turning
            force += min(2 * grip * pull(car, car.brakes.abs_slip, load / 2), brakes)
        return force - car.body.mass_kg * backward

    return brentq(excess, 0.1, 80.0)


def follow(world: World, speed: float, seconds: float) -> NDArray[np.void]:
    """Steer the first car along the centre line at a speed, m/s; returns its state, a view."""
    car = world.state[0, 0]
    for _ in range(round(seconds / DYNAMICS_DT)):
        steer = -0.02 * car["lateral"] - 0.5 * car["heading_error"]
        steer += wheelbase(world.car) * world.track.table[car["row"], 4]
        throttle = float(np.clip(speed - car["velocity_x"], -1.0, 1.0))
        world.step(np.array([[[throttle, steer / world.car.steering.full_lock_rad]]]), 1)
    return car


@cache
def tilted(slope_x: float, slope_y: float) -> Track:
    """The stadium on a plane that rises so much per metre of map to the east and to the north."""
    table = stadium().table[::5]
    x, y, tangent_x, tangent_y = table[:, :4].T
    bank = np.arctan(slope_y * tangent_x - slope_x * tangent_y)
    return road(x, y, 20.0, 40.0, z=slope_x * x + slope_y * y, bank=bank)


@cache
def hills(height: float, count: int, radius: float = 600.0, bank: float = 0.0) -> Track:
    """A banked circle on which sine hills follow each other, `height` m above and below the plain."""
    angle = np.linspace(0.0, 2 * np.pi, 720, endpoint=False)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    return road(x, y, 40.0, 60.0, z=height * np.sin(count * angle), bank=bank)


def energy(world: World) -> float:
    """Kinetic and potential energy of the first car per kilogram, J/kg."""
    cars = world.state[0].copy()
    locate_all(cars, world.course)
    car, body, wheel = cars[0], world.car.body, world.car.wheel
    climb = car["slope_x"] * car["velocity_x"] + car["slope_y"] * car["velocity_y"]
    moving = car["velocity_x"] ** 2 + car["velocity_y"] ** 2 + climb**2
    turning = body.yaw_inertia_kg_m2 * car["yaw_rate"] ** 2
    spinning = wheel.inertia_kg_m2 * (car["spin"] ** 2).sum()
    return float(0.5 * (moving + (turning + spinning) / body.mass_kg) + G * car["z"])


class TestTyre:
    @settings(deadline=None)
    @given(loads)
    def test_peaks_at_combined_slip_one_with_the_friction_of_the_load(self, load: float) -> None:
        peak = at_load(GT3, GT3.tyre.peak_slip_ratio, load)
        force = [tyre_force(share * peak, 0.0, load, 1.0, P)[0] for share in (0.95, 1.0, 1.05)]
        assert force[1] > max(force[0], force[2])
        assert force[1] == pytest.approx(at_load(GT3, GT3.tyre.friction_longitudinal, load) * load, rel=1e-6)

        peak = at_load(GT3, GT3.tyre.peak_slip_angle_rad, load)
        force = [tyre_force(0.0, share * peak, load, 1.0, P)[1] for share in (0.95, 1.0, 1.05)]
        assert force[1] > max(force[0], force[2])
        assert force[1] == pytest.approx(at_load(GT3, GT3.tyre.friction_lateral, load) * load, rel=1e-6)

    @settings(deadline=None)
    @given(slip_ratios, slip_angles, loads)
    def test_is_the_magic_formula_of_the_combined_slip(self, ratio: float, angle: float, load: float) -> None:
        x = ratio / at_load(GT3, GT3.tyre.peak_slip_ratio, load)
        y = angle / at_load(GT3, GT3.tyre.peak_slip_angle_rad, load)
        share = magic(GT3, math.hypot(x, y)) / max(math.hypot(x, y), 1e-300)
        along, across, _, _ = tyre_force(ratio, angle, load, 1.0, P)
        # The kernel's table is good to 1e-7 of the peak force, which is below 2 * load.
        most_x, most_y = (
            at_load(GT3, mu, load) * load
            for mu in (GT3.tyre.friction_longitudinal, GT3.tyre.friction_lateral)
        )
        assert along == pytest.approx(share * x * most_x, abs=2e-7 * load)
        assert across == pytest.approx(share * y * most_y, abs=2e-7 * load)

    @settings(deadline=None)
    @given(slip_ratios, slip_angles, loads)
    def test_never_leaves_the_friction_ellipse(self, ratio: float, angle: float, load: float) -> None:
        x, y, _, left = tyre_force(ratio, angle, load, 1.0, P)
        most_x = at_load(GT3, GT3.tyre.friction_longitudinal, load) * load
        most_y = at_load(GT3, GT3.tyre.friction_lateral, load) * load
        assert (x / most_x) ** 2 + (y / most_y) ** 2 <= 1.0 + 1e-6
        assert left == pytest.approx(most_x**2 * (1.0 - (y / most_y) ** 2), abs=1e-6 * most_x**2)

    @settings(deadline=None)
    @given(slip_ratios, slip_angles, loads, st.floats(0.3, 1.0))
    def test_is_odd_in_both_slips_and_proportional_to_grip(
        self, ratio: float, angle: float, load: float, grip: float
    ) -> None:
        x, y, stiffness, left = tyre_force(ratio, angle, load, 1.0, P)
        assert tyre_force(-ratio, -angle, load, 1.0, P) == (-x, -y, stiffness, left)
        assert tyre_force(-ratio, angle, load, 1.0, P) == (-x, y, stiffness, left)
        assert tyre_force(ratio, angle, load, grip, P)[:2] == pytest.approx((grip * x, grip * y))
        assert x == pytest.approx(stiffness * ratio)
        assert stiffness >= 0.0

    @each_car
    def test_friction_falls_with_load_though_the_force_grows(self, car: Car) -> None:
        load = np.linspace(500.0, 11_000.0, 40)
        force = np.array([hold(car, at_load(car, car.tyre.peak_slip_angle_rad, n), n) for n in load])
        assert (np.diff(force) > 0).all()
        assert (np.diff(force / load) < 0).all()

    def test_sliding_sideways_takes_from_the_drive(self) -> None:
        x_alone = tyre_force(0.1, 0.0, 4000.0, 1.0, P)[0]
        x, y, _, _ = tyre_force(0.1, 0.12, 4000.0, 1.0, P)
        assert 0.0 < x < 0.85 * x_alone
        assert y > 0.0


class TestEngine:
    @settings(deadline=None)
    @given(st.floats(1000.0, 7999.0))
    def test_full_torque_follows_the_curve_of_the_file(self, rpm: float) -> None:
        # The kernel's table has a point every 127 rpm; the curve bends by at most 0.08 N m per rpm,
        # so a bend between two points costs at most 0.08 * 127 / 4 = 2.5 N m.
        wanted = np.interp(rpm, GT3.engine.rpm, GT3.engine.torque_n_m)
        assert engine_torque(1.0, rpm, P) == pytest.approx(wanted, abs=2.6)

    def test_closed_throttle_drags_and_the_limiter_cuts(self) -> None:
        most = GT3.engine.braking_torque_n_m
        assert engine_torque(0.0, 4000.0, P) == pytest.approx(-most * 4000.0 / 8000.0)
        assert engine_torque(1.0, 8000.0, P) == -most
        half = engine_torque(0.5, 5000.0, P)
        assert half == pytest.approx((engine_torque(0.0, 5000.0, P) + engine_torque(1.0, 5000.0, P)) / 2)

    @each_car
    def test_acceleration_is_the_power_at_the_wheels_less_the_drags(self, car: Car) -> None:
        world = world_with(stadium(), [100.0], speed=50.0, car=car)
        before = drive(world, 1.0, seconds=1.0)[0, 0].copy()
        after = drive(world, 1.0, seconds=0.1)[0, 0]
        assert before["gear"] == after["gear"]
        speed = (before["velocity_x"] + after["velocity_x"]) / 2
        ratio = car.gearbox.ratios[after["gear"]] * car.gearbox.final_drive
        front = car.gearbox.front_share
        spins = (before["spin"] + after["spin"]) / 2
        spin = front * spins[:2].mean() + (1 - front) * spins[2:].mean()
        torque = np.interp(spin * ratio * 60 / (2 * np.pi), car.engine.rpm, car.engine.torque_n_m)
        drive_force = torque * ratio * car.gearbox.efficiency / car.wheel.radius_m
        turning = 4 * car.wheel.inertia_kg_m2 + car.engine.inertia_kg_m2 * ratio**2
        mass = car.body.mass_kg + turning / car.wheel.radius_m**2
        wanted = (drive_force - air_drag(car, speed) - rolling(car, speed)) / mass
        # The driven wheels turn faster than the road by their slip, which changes meanwhile, and an
        # engine that drives both axles feels as two: together far below 2 %.
        assert (after["velocity_x"] - before["velocity_x"]) / 0.1 == pytest.approx(wanted, rel=0.02)

    @each_car
    def test_gears_go_up_one_by_one_at_the_shift_speed(self, car: Car) -> None:
        world = world_with(stadium(), [100.0], car=car)
        gears = [int(drive(world, 1.0)[0, 0]["gear"]) for _ in range(300)]
        assert gears[0] == 0
        assert gears[-1] == len(car.gearbox.ratios) - 1
        assert set(np.diff(gears)) == {0, 1}

    @each_car
    def test_top_speed_balances_engine_against_drags(self, car: Car) -> None:
        ratio = car.gearbox.ratios[-1] * car.gearbox.final_drive
        front_share = car.gearbox.front_share

        def surplus(speed: float) -> float:
            resistance = air_drag(car, speed) + rolling(car, speed)
            slip = 0.0
            forward = resistance - rolling(car, speed)
            axles = zip(
                axle_loads(car, speed, forward / car.body.mass_kg),
                (front_share, 1 - front_share),
                strict=True,
            )
            for load, share in axles:
                if share > 0:
                    wanted = share * resistance
                    slip += share * brentq(lambda s: 2 * pull(car, s, load / 2) - wanted, 0.0, 0.05)  # noqa: B023
            rpm = speed * (1 + slip) / car.wheel.radius_m * ratio * 60 / (2 * np.pi)
            torque = np.interp(rpm, car.engine.rpm, car.engine.torque_n_m)
            return torque * ratio * car.gearbox.efficiency / car.wheel.radius_m - resistance

        wanted = brentq(surplus, 60.0, 100.0)
        state = drive(world_with(stadium(), [100.0], speed=wanted - 0.5, car=car), 1.0, seconds=45.0)[0, 0]
        assert state["gear"] == len(car.gearbox.ratios) - 1
        # The kernel's table of torque is off by at most 2.6 N m of some 500, which a third of the
        # share shows in the speed.
        assert state["velocity_x"] == pytest.approx(wanted, rel=1.7e-3)

    @pytest.mark.parametrize("car", [GT3, CARS["prototype"], FRONT_DRIVEN])
    def test_launch_is_limited_by_the_grip_of_the_driven_wheels(self, car: Car) -> None:
        driven = 0 if car.gearbox.front_share == 1.0 else 1
        world = world_with(stadium(), [100.0], car=car)
        state = drive(world, 1.0, seconds=1.6)[0, 0]
        speed = state["velocity_x"]
        free = 2 * car.wheel.inertia_kg_m2 / car.wheel.radius_m**2  # two wheels that the road has to turn

        def excess(forward: float) -> float:
            load = axle_loads(car, speed, forward)[driven]
            force = 2 * pull(car, car.engine.traction_slip, load / 2) - rolling(car, speed)
            return force - (car.body.mass_kg + free) * forward

        forward = brentq(excess, 1.0, 20.0)
        wanted = forward - air_drag(car, speed) / car.body.mass_kg
        assert state["gear"] == 0
        # Loads lag by up to 0.13 s, after which exp(-8) is left, and follow downforce that grows.
        assert state["acceleration_x"] == pytest.approx(wanted, rel=2e-3)

    def test_wheels_spin_only_without_traction_control(self) -> None:
        world = world_with(stadium(), [100.0], car=GT3)
        slips = [drive(world, 1.0)[0, 0]["slip_ratio"][2:].max() for _ in range(30)]
        # What comes beyond is the road speed, which the control foretells from the last step.
        assert max(slips) < GT3.engine.traction_slip + 0.01
        world = world_with(stadium(), [100.0], car=changed(GT3, "engine", traction_slip=100.0))
        assert drive(world, 1.0, seconds=1.0)[0, 0]["slip_ratio"][2] > 0.5


class TestBraking:
    @each_car
    def test_distance_is_that_of_the_grip_under_the_loads(self, car: Car) -> None:
        car = changed(car, "engine", braking_torque_n_m=0.0, inertia_kg_m2=0.0)
        shortest, _ = quad(lambda v: v / deceleration(car, v), 0.0, 50.0)
        world = world_with(stadium(), [100.0], speed=50.0, car=car)
        start = world.state[0, 0]["x"]
        state = drive(world, -1.0, seconds=6.0)[0, 0]
        assert abs(state["velocity_x"]) < 0.01
        # A step moves with the speed at its end, v dt / 2 = 0.4 m less; loads build up within the lag.
        assert state["x"] - start == pytest.approx(shortest, rel=0.01)

    @pytest.mark.parametrize("car", [*CARS.values(), FRONT_DRIVEN])
    @pytest.mark.parametrize(("speed", "throttle"), [(40.0, -1.0), (70.0, -1.0), (3.0, 1.0)])
    def test_brakes_and_drive_never_exceed_the_grip(self, car: Car, speed: float, throttle: float) -> None:
        world = world_with(stadium(), [100.0], speed=speed, car=car)
        front = car.gearbox.front_share
        driven = slice(4) if throttle < 0 else slice(0 if front > 0 else 2, 2 if front == 1.0 else 4)
        state = world.state[0, 0]
        for _ in range(90):
            before = state["velocity_x"]
            world.step(np.array([[[throttle, 0.0]]]), 1)
            force = car.body.mass_kg * state["acceleration_x"] + air_drag(car, before)
            roll = (car.wheel.rolling_resistance * state["load"]).sum()
            friction = [at_load(car, car.tyre.friction_longitudinal, n) * n for n in state["load"]]
            assert abs(force) <= sum(friction[driven]) + roll + 1e-6

    def test_wheels_lock_only_without_slip_control(self) -> None:
        world = world_with(stadium(), [100.0], speed=50.0)
        with_control = [drive(world, -1.0)[0, 0]["slip_ratio"].min() for _ in range(20)]
        assert min(with_control) > -GT3.brakes.abs_slip - 0.01

        world = world_with(stadium(), [100.0], speed=50.0, car=changed(GT3, "brakes", abs_slip=10.0))
        state = drive(world, -1.0, seconds=1.0)[0, 0]
        assert state["slip_ratio"][0] == pytest.approx(-1.0)
        assert state["spin"][0] == pytest.approx(0.0, abs=1e-9)

    @each_car
    def test_brakes_hold_the_car_on_a_grade(self, car: Car) -> None:
        grade = 0.15
        state = drive(world_with(tilted(grade, 0.0), [1000.0], car=car), -1.0, seconds=4.0)[0, 0]
        cosine = 1 / math.hypot(1.0, grade)
        weight = car.body.mass_kg * G
        height, rear_axle = car.body.centre_of_mass_height_m, car.body.rear_axle_m
        assert state["load"].sum() == pytest.approx(weight * cosine, rel=1e-6)
        front = weight * cosine * (rear_axle - grade * height) / wheelbase(car)
        assert state["load"][:2].sum() == pytest.approx(front, rel=1e-3)
        # A tyre pulls only where it slips, and slip is formed with at least 6 m/s: locked wheels
        # creep until that holds the weight.
        creep = -state["velocity_x"]
        held = sum(pull(car, creep / 6.0, n) for n in state["load"])
        assert 0.0 < creep < 0.05
        assert held == pytest.approx(weight * cosine * grade, rel=0.02)
        assert abs(state["acceleration_x"]) < 1e-3


class TestStraight:
    def test_cross_slope_leans_on_the_lower_wheels(self) -> None:
        grade, body = 0.12, GT3.body
        state = drive(world_with(tilted(0.0, grade), [1000.0]), -1.0, seconds=4.0)[0, 0]
        moment = body.mass_kg * G * grade / math.hypot(1.0, grade) * body.centre_of_mass_height_m
        share = body.roll_stiffness_front_share
        left_front, right_front, left_rear, right_rear = state["load"]
        # The wheels creep down the slope, and turn the car a little.
        assert right_front - left_front == pytest.approx(2 * moment * share / body.front_track_m, rel=0.01)
        assert right_rear - left_rear == pytest.approx(2 * moment * (1 - share) / body.rear_track_m, rel=0.01)

    @each_car
    def test_at_rest_it_stays_at_rest_and_its_loads_are_its_weight(self, car: Car) -> None:
        state = drive(world_with(stadium(), [100.0], car=car), 0.0, 1.0, seconds=5.0)[0, 0]
        assert (state["velocity_x"], state["velocity_y"], state["yaw_rate"]) == (0.0, 0.0, 0.0)
        assert (state["load"][0], state["load"][2]) == (state["load"][1], state["load"][3])
        assert (state["load"][:2].sum(), state["load"][2:].sum()) == pytest.approx(axle_loads(car, 0.0))

    def test_acceleration_moves_load_to_the_rear(self) -> None:
        state = drive(world_with(stadium(), [100.0], speed=26.0), 1.0, seconds=0.7)[0, 0]
        front, rear = axle_loads(GT3, state["velocity_x"], state["carried_x"])
        # Loads were set at the beginning of the substep: 1/60 s at 10 m/s^2 is 0.17 m/s of speed.
        assert state["load"][:2].sum() == pytest.approx(front, rel=0.005)
        assert state["load"][2:].sum() == pytest.approx(rear, rel=0.005)
        drag = air_drag(GT3, state["velocity_x"]) / GT3.body.mass_kg
        assert state["carried_x"] == pytest.approx(state["acceleration_x"] + drag, rel=0.02)
        assert rear - front > 3000.0

    def test_rolls_down_a_uniform_slope(self) -> None:
        for grade in (0.1, -0.1):
            world = world_with(tilted(grade, 0.0), [2000.0], speed=40.0, car=FREE)
            state = drive(world, 0.0, seconds=5.0)[0, 0]
            # On the map a mass that slides on a plane is slowed by g G / (1 + G^2).
            wanted = 40.0 - 5.0 * G * grade / (1 + grade**2)
            assert state["velocity_x"] == pytest.approx(wanted, rel=1e-5)

    @pytest.mark.parametrize(("surface", "drag"), [("tarmac", 0.0), ("grass", 0.065), ("gravel", 0.22)])
    def test_run_off_slows(self, surface: str, drag: float) -> None:
        points = stadium().table[::5, :2]
        track = road(points[:, 0], points[:, 1], 20.0, 40.0, runoff=surface)
        car = changed(GT3, "engine", braking_torque_n_m=0.0)
        world = world_with(track, [1000.0], lateral=30.0, speed=30.0, car=car)
        state = drive(world, 0.0, seconds=1.0)[0, 0]
        assert state["off_course"]
        speed = state["velocity_x"]
        load = car.body.mass_kg * G + downforce(car, speed)
        ratio = world.parameters.ratios[state["gear"]]
        turning = 4 * car.wheel.inertia_kg_m2 + car.engine.inertia_kg_m2 * ratio**2
        wanted = air_drag(car, speed) + (car.wheel.rolling_resistance + drag) * load * speed / (speed + 0.5)
        wanted /= car.body.mass_kg + turning / car.wheel.radius_m**2
        assert -state["acceleration_x"] == pytest.approx(wanted, rel=0.01)

    @pytest.mark.parametrize(("surface", "grip"), [("tarmac", 1.0), ("grass", 0.55), ("gravel", 0.48)])
    def test_run_off_has_its_grip(self, surface: str, grip: float) -> None:
        points = stadium().table[::5, :2]
        track = road(points[:, 0], points[:, 1], 20.0, 40.0, runoff=surface)
        drag = {"tarmac": 0.0, "grass": 0.065, "gravel": 0.22}[surface]
        car = changed(FREE, "brakes", torque_n_m=50_000.0)
        state = drive(world_with(track, [1000.0], 30.0, speed=30.0, car=car), -1.0, seconds=0.8)[0, 0]
        wanted = deceleration(car, state["velocity_x"], grip, drag)
        assert -state["acceleration_x"] == pytest.approx(wanted, rel=5e-3)

    def test_kerb_shakes_without_adding_load(self) -> None:
        points = stadium().table[::5, :2]
        kerb = [{"side": "left", "start_m": 500.0, "end_m": 4000.0, "width_m": 2.0}]
        track = road(points[:, 0], points[:, 1], 8.0, 20.0, kerb=kerb)
        world = world_with(track, [1000.0], lateral=8.0)
        grip, drag, shake = np.empty(4), np.empty(4), np.empty(4)
        shakes = []
        for place in np.linspace(0.0, 23.0, 230, endpoint=False):
            world.state[0, 0]["progress"] = 1000.0 + place
            out = stand_on(
                world.state[0, 0], 0.0, 1.0, False, grip, drag, shake, world.parameters, world.course
            )
            shakes.append(shake.copy())
            assert out == 0
            np.testing.assert_allclose(grip, [0.92, 1.0, 0.92, 1.0])
        np.testing.assert_allclose(np.mean(shakes, axis=0), 1.0, atol=1e-3)
        np.testing.assert_allclose(np.ptp(shakes, axis=0), [0.4, 0.0, 0.4, 0.0], atol=0.05)


class TestBend:
    def test_slow_bend_has_the_radius_of_its_geometry(self) -> None:
        world = world_with(PLANE, [100.0], speed=4.0)
        for _ in range(60):
            speed = world.state[0, 0]["velocity_x"]
            state = drive(world, float(np.clip(4.0 - speed + 0.03, -1.0, 1.0)), 0.5)[0, 0]
        # At 4 m/s the tyres' slip angles are below 0.01 rad, 3 % of the steering angle.
        radius = wheelbase(GT3) / math.tan(0.5 * GT3.steering.full_lock_rad)
        assert state["velocity_x"] / state["yaw_rate"] == pytest.approx(radius, rel=0.03)

    @each_car
    @pytest.mark.parametrize("speed", [20.0, 45.0])
    def test_small_steering_turns_the_car_as_the_linear_bicycle(self, car: Car, speed: float) -> None:
        car = changed(car, "engine", braking_torque_n_m=0.0, inertia_kg_m2=0.0)
        car = changed(car, "wheel", rolling_resistance=0.0)
        car = changed(car, "aero", drag_area_m2=0.0)
        car = changed(car, "gearbox", differential_lock_n_m_s=0.0)
        base = wheelbase(car)
        stiffness = [2 * hold(car, 1e-5, n / 2) / 1e-5 for n in axle_loads(car, speed)]
        gradient = car.body.rear_axle_m / stiffness[0] - car.body.front_axle_m / stiffness[1]
        gradient *= car.body.mass_kg / base
        angle = 1.0 * (base / speed**2 + gradient)  # for 1 m/s^2
        world = world_with(PLANE, [100.0], speed=speed, car=car)
        state = drive(world, 0.0, angle / car.steering.full_lock_rad, seconds=4.0)[0, 0]
        lateral = state["velocity_x"] * state["yaw_rate"]
        wanted = angle / (base / state["velocity_x"] ** 2 + gradient)
        # At 1 m/s^2, a tenth of the grip, the tyres have lost 1 % of their stiffness, in which the axles
        # hardly differ.
        assert lateral == pytest.approx(wanted, rel=3e-3)
        assert base / 100.0**2 + gradient > 0.0  # stable at any speed it reaches

    def test_differential_resists_the_bend(self) -> None:
        radii = []
        for lock in (0.0, GT3.gearbox.differential_lock_n_m_s):
            world = world_with(
                PLANE, [100.0], speed=20.0, car=changed(GT3, "gearbox", differential_lock_n_m_s=lock)
            )
            state = drive(world, 0.1, 0.05, seconds=3.0)[0, 0]
            radii.append(state["velocity_x"] / state["yaw_rate"])
        assert radii[1] > 1.01 * radii[0]

    def test_steady_bend_balances_forces_moments_and_loads(self) -> None:
        world = world_with(PLANE, [100.0], speed=30.0)
        for _ in range(80):
            speed = world.state[0, 0]["velocity_x"]
            state = drive(world, float(np.clip(30.0 - speed + 0.08, -1.0, 1.0)), 0.12)[0, 0]
        lateral, body = state["acceleration_y"], GT3.body
        assert lateral > 5.0
        # In a steady bend the acceleration is v r; the remainder of the transient is below 1 %.
        assert lateral == pytest.approx(state["velocity_x"] * state["yaw_rate"], rel=0.01)
        roll = body.mass_kg * lateral * body.centre_of_mass_height_m
        share = body.roll_stiffness_front_share
        left_front, right_front, left_rear, right_rear = state["load"]
        assert right_front - left_front == pytest.approx(2 * roll * share / body.front_track_m, rel=0.01)
        assert right_rear - left_rear == pytest.approx(2 * roll * (1 - share) / body.rear_track_m, rel=0.01)

    @staticmethod
    def axle_limit(car: Car, speed: float, front: bool) -> float:
        """Lateral acceleration at which an axle has no more to give, the other being willing."""
        body = car.body
        share = body.roll_stiffness_front_share if front else 1 - body.roll_stiffness_front_share
        track = body.front_track_m if front else body.rear_track_m
        arm = body.rear_axle_m if front else body.front_axle_m
        load = axle_loads(car, speed, air_drag(car, speed) / body.mass_kg)[0 if front else 1]

        def short(lateral: float) -> float:
            move = min(body.mass_kg * lateral * body.centre_of_mass_height_m * share / track, load / 2)
            tyres = load / 2 - move, load / 2 + move
            best = minimize_scalar(
                lambda angle: -sum(hold(car, angle, n) for n in tyres), bounds=(0.02, 0.4), method="bounded"
            )
            return -best.fun - body.mass_kg * lateral * arm / wheelbase(car)

        return brentq(short, 1.0, 80.0)

    @pytest.mark.parametrize("car", [*CARS.values(), FRONT_DRIVEN], ids=[*CARS, "front-driven"])
    @pytest.mark.parametrize("speed", [20.0, 40.0, 60.0, 80.0])
    def test_limit_is_the_grip_of_the_front_axle_and_beyond_it_the_car_does_not_spin(
        self, car: Car, speed: float
    ) -> None:
        # An engine of any strength, without a limiter, that the speed may be held.
        car = changed(car, "engine", torque_n_m=tuple(2 * value for value in car.engine.torque_n_m))
        world = world_with(PLANE, [100.0], speed=speed, car=car)
        state = world.state[0, 0]
        limit = self.axle_limit(car, speed, front=True)
        angle = wheelbase(car) * limit / speed**2 + 0.12
        peak = state.copy()
        for step in range(900):
            wanted = angle * min(step / 720, 1.0) / car.steering.full_lock_rad
            throttle = float(np.clip((speed - state["velocity_x"]) * 0.7 + 0.1, -1.0, 1.0))
            world.step(np.array([[[throttle, wanted]]]), 1)
            if state["acceleration_y"] > peak["acceleration_y"]:
                peak = state.copy()
            assert abs(math.atan2(state["velocity_y"], state["velocity_x"])) < 0.2
        assert 0.9 < peak["velocity_x"] / speed < 1.01
        limit = self.axle_limit(car, peak["velocity_x"], front=True)
        assert limit < self.axle_limit(car, peak["velocity_x"], front=False)
        # The limit stands for the axle's force across the car, to which steered tyres give their
        # cosine, and has to turn the car against the differential: its torque over a track's width,
        # with the difference of spins that the bend makes, over the lever of the rear axle.
        levers = car.body.rear_track_m**2 / car.wheel.radius_m**2 / car.body.rear_axle_m
        held = car.gearbox.differential_lock_n_m_s * peak["yaw_rate"] * levers / car.body.mass_kg
        reached = (peak["acceleration_y"] + held) / math.cos(peak["steering"])
        # Driven front wheels pull the nose in, by up to 3 %; the inner tyre of those that carry least
        # peaks earlier than the outer one, and slips that still change at the peak take some more.
        assert 0.96 < reached / limit < 1.03

    def test_left_and_right_mirror_each_other(self) -> None:
        cars = [drive(world_with(stadium(), [1000.0], speed=40.0), 0.3, s, 2.0)[0, 0] for s in (0.1, -0.1)]
        assert cars[0]["y"] == pytest.approx(-cars[1]["y"], abs=1e-6)
        assert cars[0]["yaw_rate"] == pytest.approx(-cars[1]["yaw_rate"], abs=1e-9)
        assert cars[0]["yaw_rate"] > 0.0


class TestRoadInSpace:
    @pytest.mark.parametrize("share", [0.5, 1.0, 1.4])
    def test_bank_carries_the_car_at_its_neutral_speed(self, share: float) -> None:
        radius, tilt = 300.0, math.tan(0.25)
        neutral = math.sqrt(G * radius * tilt)
        world = world_with(circle(radius, bank=-0.25), [0.0], speed=share * neutral, car=FREE)
        state = follow(world, share * neutral, 12.0)
        speed, at = state["velocity_x"], radius - state["lateral"]
        cosine, sine = math.cos(0.25), math.sin(0.25)
        # carried_y is the tyres' push in the plane of the road: v^2/R cos - g sin, nothing at the
        # neutral speed. The tyre table and the driver's last movements leave 0.02 m/s^2 of 2.5.
        wanted = speed**2 / at * cosine - G * sine
        assert state["carried_y"] == pytest.approx(wanted, abs=0.02)
        push = FREE.body.mass_kg * (G * cosine + speed**2 / at * sine)
        assert state["load"].sum() == pytest.approx(push, rel=1e-3)

    @pytest.mark.parametrize("speed", [20.0, 50.0])
    def test_loads_follow_crests_and_dips(self, speed: float) -> None:
        height, count, radius = 3.0, 12, 600.0
        world = world_with(hills(height, count), [0.0], speed=speed, car=FREE)
        bends = []
        for _ in range(80):
            follow(world, speed, 0.25)
            car = world.state[0, 0].copy()
            world.step(np.array([[[0.0, car["steering"] / FREE.steering.full_lock_rad]]]), 1)
            wave, inside = count / radius, 1.0 - car["lateral"] / radius
            at = wave * car["progress"]
            along = math.cos(car["heading_error"]) * car["velocity_x"] / inside
            slope, bend = height * wave * math.cos(at) / inside, -height * wave**2 * math.sin(at)
            load = FREE.body.mass_kg * (G + along**2 * bend) / math.hypot(1.0, slope)
            # The road bends evenly from row to row of the circuit's table: within half of their 2 m
            # the wave's bend changes by 0.02 of its amplitude: 0.06 m/s^2, beside at least 6.8 m/s^2.
            assert world.state[0, 0]["load"].sum() == pytest.approx(load, rel=9e-3)
            bends.append(bend / (height * wave**2))
        assert min(bends) < -0.9
        assert max(bends) > 0.9

    def test_flies_over_a_sharp_crest_without_grip(self) -> None:
        world = world_with(hills(8.0, 30), [25.0], speed=60.0)
        state = world.state[0, 0]
        least = np.inf
        for _ in range(200):
            down = downforce(GT3, math.hypot(state["velocity_x"], state["velocity_y"]))
            world.step(np.zeros((1, 1, 2)), 1)
            least = min(least, state["load"].sum() / down)
        assert least == pytest.approx(1.0)

    def test_energy_is_kept_over_hills_where_nothing_takes_it(self) -> None:
        points = stadium().table
        height = np.where(
            (points[:, 1] < 100.0) & (points[:, 0] > 0.0) & (points[:, 0] < STRAIGHT_M),
            6.0 * np.sin(2 * np.pi * points[:, 0] / 600.0) ** 2,
            0.0,
        )
        track = road(points[::5, 0], points[::5, 1], 20.0, 40.0, z=height[::5])
        world = world_with(track, [300.0], speed=30.0, car=FREE)
        found = [energy(world)]
        for _ in range(300):
            drive(world, 0.0)
            found.append(energy(world))
        # A semi-implicit step keeps an energy that differs from this one by v g G dt / 2.
        bound = 1.1 * 30.0 * G * 6.0 * np.pi / 300.0 * DYNAMICS_DT / 2
        assert np.ptp(found) < 2 * bound
        assert abs(found[-1] - found[0]) < 2 * bound
        assert world.state[0, 0]["x"] > 800.0

    @settings(max_examples=25, deadline=None)
    @given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(CARS)), st.floats(-0.3, 0.3))
    def test_energy_never_rises_without_the_engine(self, seed: int, name: str, bank: float) -> None:
        rng = np.random.default_rng(seed)
        track = hills(5.0, 8, radius=500.0, bank=round(bank, 1))
        speed = rng.uniform(0.0, 60.0)
        # The launch clutch never closes on a car that rolls, nor does the engine add to its mass.
        car = changed(CARS[name], "engine", inertia_kg_m2=0.0)
        world = world_with(
            track, [rng.uniform(0, 3000)], speed=speed, heading=rng.uniform(-0.5, 0.5), car=car
        )
        lowest = energy(world)
        for _ in range(60):
            world.step(np.array([[[-rng.uniform(0, 1) * rng.integers(2), rng.uniform(-1, 1)]]]), 2)
            now = energy(world)
            state = world.state[0, 0]
            way = math.hypot(state["velocity_x"], state["velocity_y"])
            # The step's own swing, v g G dt / 2 with G up to 0.4, and as much for the road's change
            # of shape.
            assert now < lowest + 0.02 * way + 0.02
            lowest = min(lowest, now)


@kernel
def run(
    cars: np.ndarray, steer: float, steps: int, dt: float, p: object, course: object, rates: Rates
) -> None:
    """Some steps of one car of any length."""
    grip, drag, shake = np.empty(4), np.empty(4), np.empty(4)
    car = cars[0]
    for _ in range(steps):
        sine, cosine = facing(car, course)
        stand_on(car, sine, cosine, False, grip, drag, shake, p, course)
        feel_road(car, sine, cosine, course)
        advance(car, steer, grip, drag, shake, dt, p, rates)
        locate(car, course)


@pytest.mark.parametrize("throttle", [0.0, 0.4, -0.3])
def test_steps_converge_in_first_order(throttle: float) -> None:
    places = []
    for fineness in (1, 2, 4, 8, 64):
        world = world_with(hills(5.0, 8, radius=500.0, bank=-0.1), [0.0], speed=40.0)
        cars = world.state[0]
        cars["throttle"], cars["brake"] = max(throttle, 0.0), max(-throttle, 0.0)
        steps = 120 * fineness
        run(cars, 0.02, steps, DYNAMICS_DT / fineness, world.parameters, world.course, Rates(0.0, 0.0))
        places.append((cars["x"][0], cars["y"][0]))
    errors = np.hypot(*(np.array(places[:-1]) - places[-1]).T)
    # A step moves with the velocity at its end: of the 25 m/s by which that turns within two seconds,
    # half a step makes 0.2 m of the 80, and the forces' delay as much again.
    assert errors[0] < 0.6
    # Errors of c (dt - dt / 64) fall by 63 / 31, 31 / 15 and 15 / 7 where c is constant.
    np.testing.assert_allclose(errors[:-1] / errors[1:], [63 / 31, 31 / 15, 15 / 7], rtol=0.1)


class TestConsumption:
    def test_fuel_burnt_is_the_consumption_of_the_work(self) -> None:
        world = world_with(stadium(), [100.0], speed=40.0, conditions=Conditions(fuel_rate=3.0))
        state, work = world.state[0, 0], 0.0
        for _ in range(600):
            spin, gear = state["spin"][2:].mean(), state["gear"]
            world.step(np.array([[[0.8, 0.0]]]), 1)
            if state["shifting"] <= 0.0:
                speed = spin * world.parameters.ratios[gear]
                work += engine_torque(0.8, speed * 60 / (2 * np.pi), P) * speed * DYNAMICS_DT
        burnt = GT3.fuel.capacity_kg - state["fuel"]
        # Steps in which a gear change begins or ends are counted by one of the two only.
        assert burnt == pytest.approx(3.0 * GT3.fuel.consumption_kg_j * work, rel=0.01)
        assert state["mass"] == pytest.approx(GT3.body.mass_kg - burnt)
        assert state["load"].sum() == pytest.approx(
            state["mass"] * G + downforce(GT3, state["velocity_x"]), rel=1e-3
        )

    def test_nothing_wears_or_burns_at_rate_zero(self) -> None:
        world = world_with(stadium(), [100.0], speed=40.0)
        state = drive(world, 1.0, 0.5, seconds=5.0)[0, 0]
        assert (state["wear"] == 0.0).all()
        assert (state["fuel"], state["mass"]) == (GT3.fuel.capacity_kg, GT3.body.mass_kg)

    def test_locked_wheels_wear_by_the_energy_of_the_car(self) -> None:
        car = changed(without_losses(GT3), "brakes", abs_slip=10.0, torque_n_m=60_000.0)
        world = world_with(stadium(), [100.0], speed=40.0, car=car, conditions=Conditions(wear_rate=1.0))
        state = drive(world, -1.0, seconds=6.0)[0, 0]
        assert state["velocity_x"] == pytest.approx(0.0, abs=0.01)
        # Half a step's way of sliding at the beginning and the worn tyres' longer way cancel to 1 %.
        kinetic = 0.5 * car.body.mass_kg * 40.0**2
        assert state["wear"].sum() * car.tyre.wear_j == pytest.approx(kinetic, rel=0.01)

    def test_wear_takes_grip(self) -> None:
        assert worn_grip(0.0) == 1.0
        grips = [worn_grip(wear) for wear in np.linspace(0.0, 5.0, 51)]
        assert (np.diff(grips) <= 0.0).all()
        assert grips[10] == pytest.approx(0.88)
        assert grips[-1] == 0.5
        car = changed(FREE, "brakes", torque_n_m=50_000.0)
        conditions = Conditions(wear_rate=1e-9)
        world = world_with(stadium(), [100.0], speed=30.0, car=car, conditions=conditions)
        world.state["wear"] = 1.0
        state = drive(world, -1.0, seconds=0.8)[0, 0]
        wanted = deceleration(car, state["velocity_x"], 0.88)
        assert -state["acceleration_x"] == pytest.approx(wanted, rel=5e-3)

    @pytest.mark.parametrize("compound", ["comfort-hard", "sports-medium", "racing-soft"])
    def test_compounds_scale_the_grip(self, compound: str) -> None:
        grip, _ = compound_ratio("racing-medium", compound)
        car = changed(FREE, "brakes", torque_n_m=50_000.0)
        world = world_with(stadium(), [100.0], speed=30.0, car=car, conditions=Conditions(compound=compound))
        state = drive(world, -1.0, seconds=0.8)[0, 0]
        wanted = deceleration(car, state["velocity_x"], grip)
        assert -state["acceleration_x"] == pytest.approx(wanted, rel=5e-3)


class TestDraught:
    @settings(deadline=None)
    @given(st.floats(0.0, 150.0), st.floats(-20.0, 20.0))
    def test_wake_fades_with_distance_and_to_both_sides(self, behind: float, beside: float) -> None:
        strength = wake(behind, beside)
        assert 0.0 <= strength <= 1.0
        assert strength == wake(behind, -beside)
        assert strength <= wake(behind, 0.0) == pytest.approx(math.exp(-behind / 45.0))

    def test_there_is_none_ahead_or_beside(self) -> None:
        assert wake(-0.1, 0.0) == 0.0
        world = world_with(stadium(), [100.0, 100.0, 140.0], lateral=[0.0, 4.0, 0.0], speed=60.0)
        first, beside, ahead = drive(world, 0.5)[0]["draught"]
        assert ahead == 0.0
        assert first == pytest.approx(wake(40.0 - GT3.body.length_m, 0.0), rel=1e-3)
        # Four metres aside at 35 m are 1.6 half-widths of the wake.
        assert beside < 0.3 * first

    def test_follower_is_faster_at_the_top_and_corners_worse(self) -> None:
        world = world_with(stadium(), [150.0, 100.0], speed=78.0)
        leader, follower = drive(world, 1.0, seconds=15.0)[0]
        assert follower["velocity_x"] > leader["velocity_x"] + 0.5
        saved = 1.0 - GT3.aero.draught_downforce_share * follower["draught"]
        wanted = GT3.body.mass_kg * G + saved * downforce(GT3, follower["velocity_x"])
        assert follower["load"].sum() == pytest.approx(wanted, rel=1e-3)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(CARS)), st.booleans())
def test_any_driving_stays_finite(seed: int, name: str, hilly: bool) -> None:
    rng = np.random.default_rng(seed)
    world = world_with(
        hills(5.0, 12, bank=-0.2) if hilly else stadium(),
        [100.0, 108.0],
        lateral=rng.uniform(-15, 15, 2).tolist(),
        speed=rng.uniform(0.0, 90.0, 2).tolist(),
        heading=rng.uniform(-3.0, 3.0, 2).tolist(),
        car=CARS[name],
        conditions=Conditions(wear_rate=50.0, fuel_rate=50.0),
    )
    for _ in range(30):
        world.step(rng.uniform(-1.0, 1.0, (1, 2, 2)))
    for field in ("x", "y", "z", "yaw", "velocity_x", "velocity_y", "yaw_rate", "spin", "load", "progress"):
        assert np.isfinite(world.state[field]).all(), field
    assert (world.state["load"] >= 0.0).all()
    assert (world.state["fuel"] >= 0.0).all()
    assert (np.hypot(world.state["velocity_x"], world.state["velocity_y"]) < 95.0).all()
    assert world.state.dtype == CAR_STATE
