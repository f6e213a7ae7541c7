"""Cars of several models in one world."""

from __future__ import annotations

import numpy as np
import pytest

from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.car import load_car
from nathlon.sim.conditions import Conditions
from nathlon.sim.observation import ANY_CAR, PLANNED, ObservationSpec
from nathlon.sim.plan import COLUMNS, Plan
from nathlon.sim.service import Service
from nathlon.sim.world import World
from tests.support.driving import GT3, stadium, start_at

MODELS = load_car("prototype"), GT3
OF = np.array([1, 0, 1, 0])
"""Index of the model of each car."""
PLACES = [300.0, 1500.0, 2700.0, 3900.0]
EVERYBODY = np.zeros(4, np.int64), np.arange(4)
RACING = Conditions(wear_rate=1.0, fuel_rate=1.0)


def mixed() -> World:
    world = World(stadium(), MODELS, 1, 4, RACING)
    world.state["model"][0] = OF
    world.reset(0, start_at(PLACES, speed=30.0))
    return world


def of_one(model: int) -> World:
    world = World(stadium(), MODELS[model], 1, 4, RACING)
    world.reset(0, start_at(PLACES, speed=30.0))
    return world


def plan(speed: float) -> Plan:
    lap = np.zeros((len(stadium().table), COLUMNS))
    lap[:, 5] = speed
    return Plan.of_lap(lap)


@pytest.mark.parametrize("version", [2, ANY_CAR, PLANNED])
def test_each_car_observes_what_it_would_in_a_race_of_its_model_alone(version: int) -> None:
    spec = ObservationSpec(version=version)
    together, plans = mixed(), [plan(50.0), plan(40.0)]
    together.show(*plans)
    together.state["steering"], together.state["fuel"] = 0.1, 20.0
    seen = together.observe(spec, *EVERYBODY)
    for model in range(2):
        alone = of_one(model)
        alone.show(plans[model])
        alone.state[:] = together.state
        rows = model == OF
        assert seen[rows].tobytes() == alone.observe(spec, *EVERYBODY)[rows].tobytes()
        assert seen[~rows].tobytes() != alone.observe(spec, *EVERYBODY)[~rows].tobytes()


def test_each_car_starts_and_drives_as_it_would_in_a_race_of_its_model_alone() -> None:
    together, alone = mixed(), [of_one(0), of_one(1)]
    for world in (together, *alone):
        world.fit(0, 3, Service("racing-soft", 30.0))
    rng = np.random.default_rng(1)
    for _ in range(80):
        actions = rng.uniform((-0.2, -0.1), (1.0, 0.1), (1, 4, 2))
        for world in (together, *alone):
            world.step(actions)
    apart = np.abs(alone[0].state["progress"] - alone[1].state["progress"])
    assert apart.min() > 1.0
    for field in ("x", "y", "yaw", "velocity_x", "fuel", "mass", "wear", "gear", "load", "tyre_grip"):
        expected = np.stack([alone[model].state[field][0, car] for car, model in enumerate(OF)])
        np.testing.assert_allclose(together.state[field][0], expected, rtol=1e-6, atol=1e-6)


def test_a_car_keeps_its_model_when_its_race_begins_again() -> None:
    world = mixed()
    world.reset(0, start_at(PLACES))
    assert [world.model(0, car).name for car in range(4)] == ["gt3", "prototype", "gt3", "prototype"]
    assert world.parameters_of(0, 0).fuel_capacity == GT3.fuel.capacity_kg == world.state["fuel"][0, 0]


def test_no_camera_sees_several_models() -> None:
    with pytest.raises(ValueError, match="expected one model"):
        mixed().observe(ObservationSpec(camera=CameraSpec()), *EVERYBODY)
