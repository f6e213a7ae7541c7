"""Tyres: the magic formula, compounds, wear; and fuel."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nathlon.sim.car import Car, compound_ratio
from nathlon.sim.clock import DYNAMICS_DT
from nathlon.sim.conditions import Conditions
from nathlon.sim.physics.powertrain import engine_torque
from nathlon.sim.physics.tyre import GONE, LEAST_GRIP, tyre_force, worn_grip
from tests.support.closed_forms import (
    FREE,
    G,
    P,
    at_load,
    changed,
    deceleration,
    downforce,
    each_car,
    hold,
    loads,
    magic,
    slip_angles,
    slip_ratios,
    without_losses,
)
from tests.support.driving import GT3, drive, stadium, world_with

OTHERS = (0.05, -0.02, 3000.0, 0.9)
"""Slips, load and grip of the tyres that are not looked at."""


def tyre(ratio: float, angle: float, load: float, grip: float) -> tuple[float, ...]:
    """What `tyre_force` returns for one tyre, the same on each of the four wheels."""
    alone = (ratio, angle, load, grip)
    found = set()
    for wheel in range(4):
        four = [tuple(a if at == wheel else b for at in range(4)) for a, b in zip(alone, OTHERS, strict=True)]
        found.add(tuple(value[wheel] for value in tyre_force(*four, P)))
    assert len(found) == 1
    return found.pop()


class TestTyre:
    @settings(deadline=None)
    @given(loads)
    def test_peaks_at_combined_slip_one_with_the_friction_of_the_load(self, load: float) -> None:
        peak = at_load(GT3, GT3.tyre.peak_slip_ratio, load)
        force = [tyre(share * peak, 0.0, load, 1.0)[0] for share in (0.95, 1.0, 1.05)]
        assert force[1] > max(force[0], force[2])
        assert force[1] == pytest.approx(at_load(GT3, GT3.tyre.friction_longitudinal, load) * load, rel=1e-6)

        peak = at_load(GT3, GT3.tyre.peak_slip_angle_rad, load)
        force = [tyre(0.0, share * peak, load, 1.0)[1] for share in (0.95, 1.0, 1.05)]
        assert force[1] > max(force[0], force[2])
        assert force[1] == pytest.approx(at_load(GT3, GT3.tyre.friction_lateral, load) * load, rel=1e-6)

    @settings(deadline=None)
    @given(slip_ratios, slip_angles, loads)
    def test_is_the_magic_formula_of_the_combined_slip(self, ratio: float, angle: float, load: float) -> None:
        x = ratio / at_load(GT3, GT3.tyre.peak_slip_ratio, load)
        y = angle / at_load(GT3, GT3.tyre.peak_slip_angle_rad, load)
        share = magic(GT3, math.hypot(x, y)) / max(math.hypot(x, y), 1e-300)
        along, across, _, _ = tyre(ratio, angle, load, 1.0)
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
        x, y, _, left = tyre(ratio, angle, load, 1.0)
        most_x = at_load(GT3, GT3.tyre.friction_longitudinal, load) * load
        most_y = at_load(GT3, GT3.tyre.friction_lateral, load) * load
        assert (x / most_x) ** 2 + (y / most_y) ** 2 <= 1.0 + 1e-6
        assert left == pytest.approx(most_x**2 * (1.0 - (y / most_y) ** 2), abs=1e-6 * most_x**2)

    @settings(deadline=None)
    @given(slip_ratios, slip_angles, loads, st.floats(0.3, 1.0))
    def test_is_odd_in_both_slips_and_proportional_to_grip(
        self, ratio: float, angle: float, load: float, grip: float
    ) -> None:
        x, y, stiffness, left = tyre(ratio, angle, load, 1.0)
        assert tyre(-ratio, -angle, load, 1.0) == (-x, -y, stiffness, left)
        assert tyre(-ratio, angle, load, 1.0) == (-x, y, stiffness, left)
        assert tyre(ratio, angle, load, grip)[:2] == pytest.approx((grip * x, grip * y))
        assert x == pytest.approx(stiffness * ratio)
        assert stiffness >= 0.0

    @each_car
    def test_friction_falls_with_load_though_the_force_grows(self, car: Car) -> None:
        load = np.linspace(500.0, 11_000.0, 40)
        force = np.array([hold(car, at_load(car, car.tyre.peak_slip_angle_rad, n), n) for n in load])
        assert (np.diff(force) > 0).all()
        assert (np.diff(force / load) < 0).all()

    def test_sliding_sideways_takes_from_the_drive(self) -> None:
        x_alone = tyre(0.1, 0.0, 4000.0, 1.0)[0]
        x, y, _, _ = tyre(0.1, 0.12, 4000.0, 1.0)
        assert 0.0 < x < 0.85 * x_alone
        assert y > 0.0


class TestConsumption:
    def test_fuel_burnt_is_the_consumption_of_the_work(self) -> None:
        world = world_with(stadium(), [100.0], speed=40.0, conditions=Conditions(fuel_rate=3.0))
        state, work = world.state[0, 0], 0.0
        for _ in range(600):
            spin, gear = state["spin"][2:].mean(), state["gear"]
            world.step(np.array([[[0.8, 0.0]]]), 1)
            if state["shifting"] <= 0.0:
                speed = spin * world.parameters.car.ratios[gear]
                work += engine_torque(0.8, speed * 60 / (2 * np.pi), P) * speed * DYNAMICS_DT
        burnt = GT3.fuel.capacity_kg - state["fuel"]
        # Steps in which a gear change begins or ends are counted by one of the two only.
        assert burnt == pytest.approx(3.0 * GT3.fuel.consumption_kg_j * work, rel=0.01)
        assert state["mass"] == pytest.approx(GT3.body.mass_kg - burnt)
        assert state["load"].sum() == pytest.approx(
            state["mass"] * G + downforce(GT3, state["velocity_x"]), rel=1e-3
        )

    def test_a_car_without_fuel_coasts(self) -> None:
        pressed, lifted = (
            world_with(stadium(), [1000.0, 100.0], speed=40.0, conditions=Conditions(fuel_rate=3.0))
            for _ in range(2)
        )
        pressed.state["fuel"][0, 1] = lifted.state["fuel"][0, 1] = 0.0
        full, empty = drive(pressed, 1.0, seconds=10.0)[0]
        assert empty["velocity_x"] < 40.0 < full["velocity_x"]
        assert empty["progress"] == drive(lifted, 0.0, seconds=10.0)[0, 1]["progress"]

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

    def test_tyres_wear_until_they_grip_no_less(self) -> None:
        car = changed(without_losses(GT3), "brakes", abs_slip=10.0, torque_n_m=60_000.0)
        world = world_with(stadium(), [100.0], speed=40.0, car=car, conditions=Conditions(wear_rate=1e6))
        wear = drive(world, -1.0, seconds=0.5)[0, 0]["wear"]
        assert (wear == GONE).all()
        assert worn_grip(GONE) == LEAST_GRIP

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
