"""What a policy is told of a car, against the car's file and in the observation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nathlon.sim.car import Car, load_car, parameters, with_grip
from nathlon.sim.car_facts import FACTS, car_facts, drive_force
from nathlon.sim.car_family import generate_car
from nathlon.sim.observation import ANY_CAR, ObservationSpec
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from nathlon.sim.tuning import Tuning, tune

DRY = np.array([1.0, 0.92, 0.55, 0.48])


def told(car: Car) -> dict[str, float]:
    names = [name for name, _, _ in FACTS]
    return dict(zip(names, car_facts(parameters(car), DRY).tolist(), strict=True))


def test_the_numbers_are_those_of_the_file() -> None:
    facts = told(load_car("gt3"))
    assert facts["mass"] == 1370.0
    assert facts["front_weight"] == pytest.approx(1.35 / 2.65)
    assert facts["grip_y_light"] == pytest.approx(1.62)
    assert facts["grip_y_heavy"] == pytest.approx(1.41)
    assert facts["brake"] == pytest.approx(10500.0 / 0.34 / 1370.0)
    assert facts["gravel_grip"] == pytest.approx(0.48)
    # 45 m/s are 132.35 rad/s of the wheels; third gear of 5.8575 turns the engine at 7,403 rpm.
    rpm = 45.0 / 0.34 * 1.65 * 3.55 * 30.0 / np.pi
    torque = np.interp(rpm, [7000.0, 7500.0], [560.0, 515.0])
    expected = torque * 1.65 * 3.55 * 0.94 / 0.34 / 1370.0
    assert facts["drive_at_45"] == pytest.approx(expected, rel=0.01)


def test_beyond_the_engine_there_is_no_drive() -> None:
    car = parameters(load_car("gt3"))
    assert drive_force(car, 200.0) == 0.0
    assert drive_force(car, 0.0) > drive_force(car, 60.0) > 0.0


def test_what_is_tuned_is_told() -> None:
    plain, tuned = load_car("coupe"), tune(load_car("coupe"), Tuning(mass=1.2, downforce=1.5, balance=0.03))
    before, after = told(plain), told(tuned)
    assert after["mass"] == pytest.approx(1.2 * before["mass"])
    assert after["downforce"] == pytest.approx(1.5 / 1.2 * before["downforce"])
    assert after["downforce_front"] == pytest.approx(before["downforce_front"] + 0.03)
    assert after["drive_at_30"] == pytest.approx(before["drive_at_30"] / 1.2, rel=1e-5)
    assert after["yaw_gyration"] == pytest.approx(before["yaw_gyration"])


def test_a_wet_road_is_less_grip() -> None:
    dry, wet = told(load_car("gt3")), told(with_grip(load_car("gt3"), 0.7))
    changed = {name for name in dry if dry[name] != wet[name]}
    assert changed == {"grip_x_light", "grip_x_heavy", "grip_y_light", "grip_y_heavy"}
    assert wet["grip_x_heavy"] == pytest.approx(0.7 * dry["grip_x_heavy"])


@settings(deadline=None)  # a seed may be drawn anew many times
@given(st.integers(0, 10_000))
def test_generated_cars_stay_near_the_ranges(seed: int) -> None:
    low, high = (np.array([fact[place] for fact in FACTS]) for place in (1, 2))
    facts = car_facts(parameters(generate_car(seed)), DRY)
    assert np.isfinite(facts).all()
    deviations = (facts - (low + high) / 2) / (high - low) * np.sqrt(12.0)
    assert np.abs(deviations).max() < 5.0


def test_observations_for_any_car_are_the_others_but_for_place_and_car() -> None:
    track, scenario = load_track("lindenring"), load_scenario("1v3")
    world = scenario.world(track, load_car("prototype"), 1)
    world.reset(0, scenario.place(track, np.random.default_rng(1)))
    for _ in range(20):
        world.step(np.tile(np.array([1.0, 0.05], np.float32), (1, 4, 1)))
    spec, other = ObservationSpec(course_points=6, version=ANY_CAR), ObservationSpec(course_points=6)
    races, cars = np.zeros(4, np.int64), np.arange(4)
    seen, plain = world.observe(spec, races, cars), world.observe(other, races, cars)
    place = spec.slice("axle_slip")
    same = np.ones(other.size, np.bool_)
    same[place] = False
    assert (seen[:, : other.size][:, same] == plain[:, same]).all()
    mean, deviation = spec.scaling
    raw = seen * deviation + mean
    slip = world.state["slip_ratio"][0].reshape(4, 2, 2).mean(axis=2)
    np.testing.assert_allclose(raw[:, place], slip, atol=1e-6)
    car = np.tile(car_facts(world.parameters.car, world.parameters.course.surface_grip), (4, 1))
    np.testing.assert_allclose(raw[:, spec.slice("car")], car, rtol=1e-4, atol=1e-7)
