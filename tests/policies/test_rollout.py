"""The driver that tries ways past others: it gets by, it repeats, and it harms nothing."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.policies.driver import practised
from nathlon.policies.load import load_policy
from nathlon.policies.planning import RolloutDriver, Scene, decide
from nathlon.policies.policy import Batch
from nathlon.sim.car import load_car
from nathlon.sim.conditions import Start
from nathlon.sim.errors import InputError
from nathlon.sim.rules import load_rules
from nathlon.sim.state import CAR_STATE
from nathlon.sim.track import load_track
from nathlon.sim.world import World

TRACK, GT3 = load_track("lindenring"), load_car("gt3")
LOOKING = "driver:rollout=3"
STRAIGHT_M = 300.0


def field(gaps: tuple[float, ...], speed: float, races: int = 1) -> World:
    """Races on a straight: a car in front, the others so many metres behind it, on its line."""
    world = World(TRACK, GT3, races, 1 + len(gaps), rules=load_rules("sporting"))
    line = practised(TRACK, GT3)
    along = STRAIGHT_M - np.array([0.0, *gaps])
    row = np.round(along / TRACK.spacing).astype(np.int64)
    n = np.full(len(along), np.inf)
    for race in range(races):
        start = Start(along, line.offset[row], line.heading[row], np.full(len(along), speed), n)
        world.reset(race, start)
    return world


def drive(world: World, last: str, others: str, steps: int) -> None:
    """Drive on, the last car of each race by one policy."""
    races, cars = world.state.shape
    policies = [load_policy(name, "lindenring", "gt3") for name in (last, others)]
    seats = [
        (np.repeat(np.arange(races), len(which)), np.tile(np.array(which), races))
        for which in ([cars - 1], range(cars - 1))
    ]
    memory = [policy.initial_memory(len(where[0])) for policy, where in zip(policies, seats, strict=True)]
    actions = np.zeros((races, cars, 2))
    for _ in range(steps):
        for k, (policy, where) in enumerate(zip(policies, seats, strict=True)):
            seen = world.observe(policy.observation_spec, *where)
            actions[where], memory[k] = decide(policy, world, *where, seen, memory[k])
        world.step(actions)


def decided(policy: RolloutDriver, world: World, races: NDArray[np.int64]) -> Batch:
    """What it does with the last cars of some races."""
    last = np.full(len(races), world.state.shape[1] - 1)
    seen = world.observe(policy.observation_spec, races, last)
    return policy.plan(Scene(world, races, last), seen, policy.initial_memory(len(seen)))[0]


def looking() -> RolloutDriver:
    policy = load_policy(LOOKING, "lindenring", "gt3")
    assert isinstance(policy, RolloutDriver)
    return policy


def test_it_gets_by_where_the_driver_stays_behind() -> None:
    by = {}
    for name in ("driver", LOOKING):
        world = field((9.0, 18.0, 27.0), 40.0)
        drive(world, name, "driver:pace=0.95", 200)
        state = world.state[0]
        by[name] = int((state["progress"][-1] > state["progress"][:-1]).sum())
        assert state["contacts_at_fault"][-1] == 0
        assert state["off_course_s"][-1] == 0.0
    assert by[LOOKING] > by["driver"]


def test_alone_it_drives_as_the_driver() -> None:
    found = []
    for name in ("driver", LOOKING):
        world = field((400.0,), 40.0)
        drive(world, name, "driver", 150)
        found.append([float(world.state[name][0, -1]) for name in ("progress", "lateral")])
    np.testing.assert_allclose(found[0], found[1], rtol=0.0, atol=0.5)


def test_looking_ahead_leaves_the_world_as_it_is_and_repeats_to_the_bit() -> None:
    world, policy = field((9.0, 18.0), 50.0, races=2), looking()
    before = {name: world.state[name].tobytes() for name in CAR_STATE.names or ()}
    first, again = (decided(policy, world, np.arange(2)) for _ in range(2))
    alone = decided(looking(), world, np.array([1]))
    assert {name: world.state[name].tobytes() for name in before} == before
    assert first.tobytes() == again.tobytes()
    assert first[1].tobytes() == alone[0].tobytes()


def test_a_car_at_rest_on_the_line_is_passed_without_a_touch() -> None:
    world = field((70.0,), 45.0)
    world.state["world_velocity_x"][0, 0] = world.state["world_velocity_y"][0, 0] = 0.0
    world.state["spin"][0, 0] = 0.0
    world.state["driving"][0, 0] = True
    drive(world, LOOKING, "driver:pace=0.2", 60)
    state = world.state[0]
    assert state["progress"][1] > state["progress"][0]
    assert state["contacts"][1] == 0


def test_it_cannot_drive_without_a_world() -> None:
    policy = looking()
    with pytest.raises(InputError, match="tries ways past others in the world itself"):
        policy.act(policy.observation_spec.blank(1), policy.initial_memory(1))
