"""Generated and tuned cars: sound, different, always the same, and as strong and grippy as they say."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from nathlon.sim.car import load_car, load_compounds, parameters, read_car
from nathlon.sim.car_check import in_short, oddities, power_w
from nathlon.sim.car_family import generate_car, write_car
from nathlon.sim.errors import InputError
from nathlon.sim.tuning import Tuning, tune
from tests.support.closed_forms import air_drag
from tests.support.driving import circle, drive, stadium, world_with

SEEDS = range(40)
GT3 = load_car("gt3")
car_of = cache(generate_car)


def test_cars_of_many_seeds_are_sound_and_cover_the_family() -> None:
    cars = [car_of(seed) for seed in SEEDS]
    assert all(oddities(car) == [] for car in cars)
    strength = [power_w(car) / car.body.mass_kg for car in cars]
    assert min(strength) < 180.0
    assert max(strength) > 450.0
    downforce = [car.aero.downforce_area_m2 for car in cars]
    assert min(downforce) < 0.6
    assert max(downforce) > 3.5
    assert {car.gearbox.front_share for car in cars} >= {0.0, 1.0}
    assert len({car.tyre.compound for car in cars}) >= 7
    for car in cars:
        if car.gearbox.front_share == 1.0:
            assert car.body.front_axle_m < car.body.rear_axle_m, "its weight is where it drives"


@pytest.mark.parametrize("seed", [0, 7, 13])
def test_a_generated_car_puts_down_the_power_that_it_has(seed: int) -> None:
    car = car_of(seed)
    world = world_with(stadium(), [100.0], speed=45.0, car=car)
    drive(world, 1.0, seconds=2.0)
    state = world.state[0, 0]
    gears = world.parameters.car.ratios
    inertia = 4 * car.wheel.inertia_kg_m2 + car.engine.inertia_kg_m2 * gears[state["gear"]] ** 2
    mass = car.body.mass_kg + inertia / car.wheel.radius_m**2
    speed, rolling = state["velocity_x"], car.wheel.rolling_resistance * state["load"].sum()
    used = (mass * state["acceleration_x"] + air_drag(car, speed) + rolling) * speed
    assert 0.75 * car.gearbox.efficiency * power_w(car) < used < 1.02 * car.gearbox.efficiency * power_w(car)


@pytest.mark.parametrize("seed", [0, 7, 13])
def test_a_generated_car_corners_and_brakes_with_the_grip_of_its_tyres(seed: int) -> None:
    car = car_of(seed)
    low, high = car.tyre.friction_lateral
    world = world_with(circle(200.0, half_width=60.0, wall=90.0), [0.0], speed=30.0, car=car)
    held = []
    for steering in np.linspace(0.0, 0.5, 40):
        state = drive(world, 0.3, float(steering), seconds=0.1)[0, 0]
        held.append(abs(state["velocity_x"] * state["yaw_rate"]))
    downforce = 0.5 * 1.2 * car.aero.downforce_area_m2 * 33.0**2 / car.body.mass_kg
    assert 0.6 * high * 9.81 < max(held) < 1.1 * low * (9.81 + downforce)
    world = world_with(stadium(), [100.0], speed=40.0, car=car)
    state = drive(world, -1.0, seconds=1.0)[0, 0]
    assert 0.6 * high * 9.81 < -state["acceleration_x"] < 1.15 * low * (9.81 + downforce)


def test_a_file_holds_the_car_and_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one.toml", "again.toml"):
        write_car(tmp_path / name, generate_car(5))
    assert read_car(tmp_path / "one.toml") == car_of(5)
    assert (tmp_path / "one.toml").read_bytes() == (tmp_path / "again.toml").read_bytes()
    assert car_of(5).body != car_of(6).body
    with pytest.raises(InputError, match=r"one\.toml: is there already"):
        write_car(tmp_path / "one.toml", GT3)


def test_gears_are_closer_the_higher_they_are_and_end_near_the_top_speed() -> None:
    for seed in SEEDS:
        car = car_of(seed)
        steps = [lower / higher for lower, higher in pairwise(car.gearbox.ratios)]
        assert steps == sorted(steps, reverse=True)
        spent = car.engine.shift_up_rpm * math.pi / 30 * car.wheel.radius_m / car.gearbox.final_drive
        top = (2 * power_w(car) * car.gearbox.efficiency / (1.2 * car.aero.drag_area_m2)) ** (1 / 3)
        assert 0.9 < spent / top < 1.08


def test_tuning_changes_what_it_says_and_nothing_else() -> None:
    tuned = tune(GT3, Tuning(mass=1.1, power=0.8, drag=1.2, downforce=0.5, balance=0.04, gearing=1.05))
    assert tuned.body.mass_kg == pytest.approx(1.1 * GT3.body.mass_kg)
    assert tuned.body.yaw_inertia_kg_m2 == pytest.approx(1.1 * GT3.body.yaw_inertia_kg_m2)
    assert power_w(tuned) == pytest.approx(0.8 * power_w(GT3))
    assert tuned.aero.drag_area_m2 == pytest.approx(1.2 * GT3.aero.drag_area_m2)
    assert tuned.aero.downforce_area_m2 == pytest.approx(0.5 * GT3.aero.downforce_area_m2)
    assert tuned.aero.downforce_front_share == pytest.approx(0.42)
    assert tuned.gearbox.final_drive == pytest.approx(1.05 * GT3.gearbox.final_drive)
    assert (tuned.tyre, tuned.brakes, tuned.steering) == (GT3.tyre, GT3.brakes, GT3.steering)
    assert tune(GT3, Tuning()) == GT3


@pytest.mark.parametrize("compound", load_compounds())
def test_a_car_on_other_tyres_is_the_car_fitted_with_them(compound: str) -> None:
    tuned = tune(GT3, Tuning(compound=compound))
    assert tuned.tyre.compound == compound
    for own, fitted in zip(parameters(tuned), parameters(GT3, compound), strict=True):
        np.testing.assert_allclose(np.asarray(own), np.asarray(fitted), rtol=1e-12)
    # Back on its own tyres it is what it was.
    back = tune(tuned, Tuning(compound=GT3.tyre.compound))
    assert back.tyre.friction_lateral == pytest.approx(GT3.tyre.friction_lateral)
    assert back.tyre.wear_j == pytest.approx(GT3.tyre.wear_j)


def test_tuning_out_of_range_is_one_sentence() -> None:
    with pytest.raises(InputError, match=r"car 'gt3' tuned: field aero.downforce_front_share is 1\.\d+: .*"):
        tune(GT3, Tuning(balance=0.7))
    with pytest.raises(InputError, match=r"compound 'rain' is unknown"):
        tune(GT3, Tuning(compound="rain"))


@pytest.mark.parametrize(
    ("section", "changes", "said"),
    [
        ("body", {"yaw_inertia_kg_m2": 9000.0}, "body.yaw_inertia_kg_m2 is 9000, expected 1443 to 2645"),
        ("body", {"length_m": 2.0}, "body.length_m is 2, expected more than the wheelbase of 2.65 m"),
        ("body", {"front_axle_m": 2.4, "rear_axle_m": 0.6}, "20 % of the weight is in front"),
        ("engine", {"shift_up_rpm": 8500.0}, "engine.shift_up_rpm is 8500, expected less than 8000"),
        ("gearbox", {"ratios": (3.0, 1.0)}, "from gear 1 the engine shifts up to 2533 rpm"),
        ("gearbox", {"ratios": (1.0, 2.0)}, "expected that they fall from gear to gear"),
        ("fuel", {"capacity_kg": 500.0}, "expected less than a tenth of the mass"),
        ("tyre", {"friction_lateral": (1.4, 1.6)}, "tyre.friction_lateral: rises with the load"),
    ],
)
def test_what_makes_no_sense_is_said(section: str, changes: dict[str, object], said: str) -> None:
    part = getattr(GT3, section).model_copy(update=changes)
    odd = oddities(GT3.model_copy(update={section: part}))
    assert any(said in sentence for sentence in odd), odd


def test_a_car_in_short() -> None:
    assert in_short(GT3) == "411 kW, 1370 kg, rear-wheel drive, racing-medium tyres"
