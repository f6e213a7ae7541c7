"""One car on a level road against closed forms: straight on, braking and in bends."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

from nathlon.sim.car import Car
from nathlon.sim.conditions import Conditions
from nathlon.sim.physics.course import SurfaceGrip, stand_on
from nathlon.sim.physics.tyre import Ground
from nathlon.sim.state import CAR_STATE
from tests.support.closed_forms import (
    CARS,
    FREE,
    FRONT_DRIVEN,
    PLANE,
    G,
    air_drag,
    at_load,
    axle_loads,
    changed,
    deceleration,
    downforce,
    each_car,
    hills,
    hold,
    pull,
    tilted,
    wheelbase,
)
from tests.support.driving import GT3, drive, road, stadium, world_with


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
        ratio = world.parameters.car.ratios[state["gear"]]
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

    @pytest.mark.parametrize("lateral", [0.0, 30.0])
    def test_conditions_scale_the_grip_of_each_surface_alone(self, lateral: float) -> None:
        points = stadium().table[::5, :2]
        track = road(points[:, 0], points[:, 1], 20.0, 40.0, runoff="gravel")
        car = changed(FREE, "brakes", torque_n_m=50_000.0)
        conditions = Conditions(grip=SurfaceGrip(tarmac=0.6, gravel=0.9))
        world = world_with(track, [1000.0], lateral, speed=30.0, car=car, conditions=conditions)
        state = drive(world, -1.0, seconds=0.8)[0, 0]
        grip, drag = (0.9 * 0.48, 0.22) if lateral else (0.6, 0.0)
        wanted = deceleration(car, state["velocity_x"], grip, drag)
        assert -state["acceleration_x"] == pytest.approx(wanted, rel=1e-2)

    def test_kerb_shakes_without_adding_load(self) -> None:
        points = stadium().table[::5, :2]
        kerb = [{"side": "left", "start_m": 500.0, "end_m": 4000.0, "width_m": 2.0}]
        track = road(points[:, 0], points[:, 1], 8.0, 20.0, kerb=kerb)
        world = world_with(track, [1000.0], lateral=8.0)
        ground = Ground(*np.empty((3, 4)))
        shakes = []
        for place in np.linspace(0.0, 23.0, 230, endpoint=False):
            world.state[0, 0]["progress"] = 1000.0 + place
            p = world.parameters
            out = stand_on(world.state[0, 0], 0.0, 1.0, False, ground, p.car, p.course)
            shakes.append(ground.shake.copy())
            assert out == 0
            np.testing.assert_allclose(ground.grip, [0.92, 1.0, 0.92, 1.0])
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
