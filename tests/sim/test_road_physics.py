"""Roads with slope, bank and crests, and kerbs, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nathlon.sim.clock import DYNAMICS_DT
from nathlon.sim.kernel import kernel
from nathlon.sim.parameters import WorldParameters
from nathlon.sim.physics.chassis import advance
from nathlon.sim.physics.course import facing, feel_road, locate, stand_on
from nathlon.sim.physics.tyre import Ground
from nathlon.sim.state import Cars
from tests.support.closed_forms import CARS, FREE, G, changed, downforce, energy, follow, hills
from tests.support.driving import GT3, STRAIGHT_M, circle, drive, road, stadium, world_with


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
def run(cars: Cars, ground: Ground, steer: float, steps: int, dt: float, p: WorldParameters) -> None:
    """Some steps of one car of any length."""
    car = cars[0]
    for _ in range(steps):
        sine, cosine = facing(car, p.course)
        stand_on(car, sine, cosine, False, ground, p.car, p.course)
        feel_road(car, sine, cosine, p.course)
        advance(car, steer, ground, dt, p.car, p.rates)
        locate(car, p.course)


@pytest.mark.parametrize("throttle", [0.0, 0.4, -0.3])
def test_steps_converge_in_first_order(throttle: float) -> None:
    places = []
    for fineness in (1, 2, 4, 8, 64):
        world = world_with(hills(5.0, 8, radius=500.0, bank=-0.1), [0.0], speed=40.0)
        cars = world.state[0]
        cars["throttle"], cars["brake"] = max(throttle, 0.0), max(-throttle, 0.0)
        steps = 120 * fineness
        ground = Ground(*np.empty((3, 4)))
        run(cars, ground, 0.02, steps, DYNAMICS_DT / fineness, world.parameters)
        places.append((cars["x"][0], cars["y"][0]))
    errors = np.hypot(*(np.array(places[:-1]) - places[-1]).T)
    # A step moves with the velocity at its end: of the 25 m/s by which that turns within two seconds,
    # half a step makes 0.2 m of the 80, and the forces' delay as much again.
    assert errors[0] < 0.6
    # Errors of c (dt - dt / 64) fall by 63 / 31, 31 / 15 and 15 / 7 where c is constant.
    np.testing.assert_allclose(errors[:-1] / errors[1:], [63 / 31, 31 / 15, 15 / 7], rtol=0.1)
