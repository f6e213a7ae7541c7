"""Engine, gears and drive against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from nathlon.sim.car import Car
from nathlon.sim.physics.powertrain import engine_torque
from nathlon.sim.state import CAR_STATE
from tests.support.closed_forms import (
    CARS,
    FRONT_DRIVEN,
    P,
    air_drag,
    axle_loads,
    changed,
    each_car,
    pull,
    rolling,
)
from tests.support.driving import GT3, drive, stadium, start_at, world_with


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


class TestReverse:
    def test_a_brake_that_is_held_at_rest_drives_back_slowly_until_the_throttle_is_pressed(self) -> None:
        world = world_with(stadium(), [1000.0])
        world.state["has_reverse"] = True
        drive(world, -1.0, seconds=0.4)
        assert abs(world.state["velocity_x"][0, 0]) < 1e-3
        car = drive(world, -1.0, seconds=3.0)[0, 0].copy()
        assert -4.0 < car["velocity_x"] < -2.0
        assert (car["gear"], car["brake"]) == (-1, 0.0)
        # Half of the pedal pulls half as much; without a pedal it rolls.
        assert drive(world, 0.0, seconds=0.5)[0, 0]["velocity_x"] < -1.0
        car = drive(world, 1.0, seconds=3.0)[0, 0]
        assert car["gear"] >= 0
        assert car["velocity_x"] > 5.0

    def test_it_keeps_its_reverse_gear_at_a_new_start_and_is_not_stuck_while_it_backs(self) -> None:
        world = world_with(stadium(), [1000.0])
        world.state["has_reverse"] = True
        world.reset(0, start_at([1000.0]))
        car = drive(world, -1.0, seconds=8.0)[0, 0]
        assert car["velocity_x"] < -2.0
        assert car["stationary_s"] == 0.0

    def test_without_one_it_stays(self) -> None:
        car = drive(world_with(stadium(), [1000.0]), -1.0, seconds=3.0)[0, 0]
        assert abs(car["velocity_x"]) < 1e-3
        assert car["gear"] == 0

    def test_it_changes_nothing_for_who_holds_no_brake_at_rest(self) -> None:
        worlds = [world_with(stadium(), [1000.0, 1003.0, 1030.0], speed=[0.0, 5.0, 30.0]) for _ in range(2)]
        worlds[1].state["has_reverse"] = True
        rng = np.random.default_rng(1)
        for _ in range(200):
            pedals = rng.uniform(-1.0, 1.0, 3)
            slow = worlds[0].state["velocity_x"][0] < 3.0
            actions = np.stack([np.where(slow, np.abs(pedals), pedals), rng.uniform(-0.3, 0.3, 3)], axis=-1)
            for world in worlds:
                world.step(actions[None])
        without, fitted = (world.state for world in worlds)
        for name in set(CAR_STATE.names or ()) - {"has_reverse", "held_s"}:
            assert without[name].tobytes() == fitted[name].tobytes(), name
