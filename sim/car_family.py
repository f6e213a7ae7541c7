"""Cars without end: a seed gives a car between road car and prototype, always the same.

A car is a mixture of the shipped ones in chance shares, tuned by lot. Its engine drives the rear, the front
or all wheels, and its gears fit its top speed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from nathlon.sim.car import Car, load_car, load_compounds
from nathlon.sim.car_check import in_short, oddities, power_w
from nathlon.sim.data_file import checked
from nathlon.sim.errors import InputError
from nathlon.sim.physics.chassis import AIR_DENSITY
from nathlon.sim.tuning import Tuning, fit_compound, tune
from nathlon.sim.whole_file import write_whole, writing

PARENTS = ("coupe", "gt3", "prototype")
EVENNESS = 0.7
"""Of the shares; below 1 most cars are near to one parent."""
TRIES = 100
DIGITS = 4
"""Significant digits of a generated file."""
COMMON = "racing-medium"
"""Tyres on which parents are mixed."""
ENGINE_POINTS = 10
MASS, POWER, DRAG, DOWNFORCE = (0.85, 1.2), (0.4, 1.15), (0.85, 1.25), (0.4, 1.3)
BALANCE, BALLAST_SHIFT = 0.02, 0.02
DRIVEN = {"rear": 0.5, "all": 0.25, "front": 0.25}
STRONGEST_FRONT_W_KG = 210.0
"""More power than this cannot be put down by the front wheels alone."""
FRONT_DRIVEN_WEIGHT = 0.6
GEARS, FIRST_OVER_TOP, PROGRESSION = (5, 7), (3.0, 3.7), 0.35
TOP_GEAR = (0.94, 1.04)
"""Speed at which the top gear is spent, over the top speed by power and drag."""
RELAXED = 0.92
"""Engine speed below which it shifts down, over the least to which it shifts up."""


def generate_car(seed: int) -> Car:
    """The car of a seed; the same one each time.

    Raises:
        InputError: if none of a number of tries makes sense.
    """
    rng = np.random.default_rng(seed)
    for _ in range(TRIES):
        car = _draw_car(f"car-{seed}", rng)
        if not oddities(car):
            return car
    raise InputError(f"--seed {seed}: no sound car in {TRIES} tries, expected another seed")


def write_car(path: Path, car: Car) -> None:
    """Write a car's file, whole or not at all.

    Raises:
        InputError: if it is there already, or cannot be written.
    """
    if path.exists():
        raise InputError(f"{path}: is there already, expected the name of a new file")
    fields = car.model_dump(mode="json")
    lines = _assignments({name: value for name, value in fields.items() if not isinstance(value, dict)})
    for name, table in fields.items():
        if isinstance(table, dict):
            lines += ["", f"[{name}]", *_assignments(table)]
    with writing(path, "car"):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, "\n".join(lines) + "\n")


def _assignments(table: Mapping[str, Any]) -> list[str]:
    # Strings, numbers and lists of numbers read the same in JSON and TOML.
    return [f"{name} = {json.dumps(value)}" for name, value in table.items()]


def _draw_car(name: str, rng: np.random.Generator) -> Car:
    shares = rng.dirichlet([EVENNESS] * len(PARENTS))
    car = _mixed(name, shares)
    compounds = [name for name, one in load_compounds().items() if not one.treaded]
    # Road cars on comfort and sports tyres, racing cars on sports and racing ones.
    fitting = compounds[:6] if shares[0] > 0.5 else compounds[3:]
    tuning = Tuning(
        mass=rng.uniform(*MASS),
        power=rng.uniform(*POWER),
        drag=rng.uniform(*DRAG),
        downforce=rng.uniform(*DOWNFORCE),
        balance=rng.uniform(-BALANCE, BALANCE),
        compound=fitting[rng.integers(len(fitting))],
    )
    fields = tune(car, tuning).model_dump()
    _draw_driven(fields, rng)
    _draw_gears(fields, rng)
    drawn = checked(_rounded(fields), Car, name)
    return drawn.model_copy(update={"description": in_short(drawn)})


def _mixed(name: str, shares: np.ndarray) -> Car:
    """The mean of the parents with given shares, on common tyres."""
    parents = []
    for parent in PARENTS:
        fields = fit_compound(load_car(parent), COMMON).model_dump()
        engine = fields["engine"]
        rpm = np.linspace(engine["rpm"][0], engine["rpm"][-1], ENGINE_POINTS)
        engine["torque_n_m"] = list(np.interp(rpm, engine["rpm"], engine["torque_n_m"]))
        engine["rpm"] = list(rpm)
        fields["gearbox"]["ratios"] = [1.0]  # drawn once power and drag are known
        parents.append(fields)
    return checked({**_mean(parents, shares), "name": name, "description": ""}, Car, name)


def _mean(values: list[Any], shares: np.ndarray) -> Any:
    """The weighted mean of all numbers in values that are built alike; of words the first."""
    first = values[0]
    if isinstance(first, dict):
        return {key: _mean([value[key] for value in values], shares) for key in first}
    if isinstance(first, list | tuple):
        return [_mean(list(those), shares) for those in zip(*values, strict=True)]
    return first if isinstance(first, str) else float(np.dot(shares, values))


def _draw_driven(fields: dict[str, Any], rng: np.random.Generator) -> None:
    """Choose the driven wheels, and put the weight where such cars have it."""
    body, brakes, gearbox = fields["body"], fields["brakes"], fields["gearbox"]
    driven = str(rng.choice(list(DRIVEN), p=list(DRIVEN.values())))
    weak = power_w(Car.model_validate(fields)) < STRONGEST_FRONT_W_KG * body["mass_kg"]
    if driven == "front" and not weak:
        driven = "rear"
    gearbox["front_share"] = {"rear": 0.0, "all": rng.uniform(0.25, 0.5), "front": 1.0}[driven]
    wheelbase = body["front_axle_m"] + body["rear_axle_m"]
    before = body["rear_axle_m"] / wheelbase
    in_front = FRONT_DRIVEN_WEIGHT if driven == "front" else before
    in_front += rng.uniform(-BALLAST_SHIFT, BALLAST_SHIFT)
    rod = body["front_axle_m"] * body["rear_axle_m"]
    body["front_axle_m"], body["rear_axle_m"] = (1.0 - in_front) * wheelbase, in_front * wheelbase
    body["yaw_inertia_kg_m2"] *= body["front_axle_m"] * body["rear_axle_m"] / rod
    brakes["front_share"] += in_front - before


def _draw_gears(fields: dict[str, Any], rng: np.random.Generator) -> None:
    """Gears for the top speed, closer together the higher they are."""
    engine, gearbox = fields["engine"], fields["gearbox"]
    power = power_w(Car.model_validate(fields)) * gearbox["efficiency"]
    top = (2.0 * power / (AIR_DENSITY * fields["aero"]["drag_area_m2"])) ** (1.0 / 3.0)
    spent = top * rng.uniform(*TOP_GEAR)
    gearbox["final_drive"] = engine["shift_up_rpm"] * math.pi / 30.0 * fields["wheel"]["radius_m"] / spent
    count = int(rng.integers(GEARS[0], GEARS[1] + 1))
    steps = np.linspace(1.0 + PROGRESSION, 1.0 - PROGRESSION, count - 1)
    steps *= math.log(rng.uniform(*FIRST_OVER_TOP)) / steps.sum()
    gearbox["ratios"] = [*np.exp(np.cumsum(steps[::-1])[::-1]), 1.0]
    after = engine["shift_up_rpm"] * np.exp(-steps.max())
    engine["shift_down_rpm"] = min(engine["shift_down_rpm"], RELAXED * after)


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(inner) for inner in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value
