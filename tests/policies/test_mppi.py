"""Planning around a policy: it repeats, it does what the objective says, and it harms nothing."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.arena.entrant import enter, weights
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.runner import run_match
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.checkpoint import read_checkpoint
from nathlon.policies.load import load_policy
from nathlon.policies.planning import Scene, decide
from nathlon.policies.planning.foresight import Foresight
from nathlon.policies.planning.prior import Prior
from nathlon.policies.policy import Batch
from nathlon.policies.sources.finding import find_sources
from nathlon.policies.sources.identity import policy_id
from nathlon.sim.data_file import DATA
from nathlon.sim.episode import Episodes
from nathlon.sim.errors import InputError
from nathlon.sim.state import CAR_STATE
from nathlon.sim.world import World

CHECKPOINT = BUNDLED / "lindenring" / "lindenring-mend-059k.safetensors"
CIRCUIT, CAR = "lindenring", "gt3"


def source(objective: str) -> str:
    return f"mppi:{CHECKPOINT}?objective={objective}"


def prior() -> Prior:
    return Prior(*read_checkpoint(CHECKPOINT))


def races(scenario: str, count: int, seconds: float = 0.0) -> Episodes:
    """Races of the bundled policy, so many seconds after their start."""
    episodes = Episodes(CIRCUIT, CAR, scenario, races=count)
    policy = load_policy(str(CHECKPOINT), CIRCUIT, CAR)
    where = everybody(episodes.world)
    view = episodes.watch(policy.observation_spec, *where)
    episodes.start(range(count), [np.random.default_rng(race) for race in range(count)])
    for _ in range(round(10 * seconds)):
        actions, _ = policy.act(view.seen, policy.initial_memory(len(view.seen)))
        episodes.step(actions.reshape(*episodes.endings.shape, 2))
    return episodes


def everybody(world: World) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    count, cars = world.state.shape
    return np.repeat(np.arange(count), cars), np.tile(np.arange(cars), count)


def decided(name: str, world: World) -> tuple[Batch, Batch]:
    """What a policy does with all cars of a world at its first decision."""
    policy = load_policy(name, CIRCUIT, CAR)
    where = everybody(world)
    seen = world.observe(policy.observation_spec, *where)
    return decide(policy, world, *where, seen, policy.initial_memory(len(seen)))


def test_it_does_more_of_what_the_objective_pays_for() -> None:
    world = races("1v0", 6, seconds=8.0).world
    own, _ = decided(str(CHECKPOINT), world)
    planned, _ = decided(source("-2 * speed / (m/s)"), world)
    change = (planned - own)[:, 0]
    assert change.max() < 0.02
    assert change.min() < -0.1


def test_an_objective_that_says_nothing_changes_next_to_nothing() -> None:
    world = races("1v0", 6, seconds=8.0).world
    own, _ = decided(str(CHECKPOINT), world)
    planned, _ = decided(source("0.000001 * speed * s / m"), world)
    assert np.abs(planned - own).max() < 0.05


def test_planning_leaves_the_world_as_it_is_and_repeats_to_the_bit() -> None:
    world = races("1v3", 2, seconds=3.0).world
    before = {name: world.state[name].tobytes() for name in CAR_STATE.names or ()}
    first, memory = decided(source("-kerb - touching"), world)
    again, _ = decided(source("-kerb - touching"), world)
    assert {name: world.state[name].tobytes() for name in before} == before
    assert first.tobytes() == again.tobytes()
    assert np.abs(memory).max() > 0.0


def test_what_is_foreseen_for_a_car_alone_is_what_happens() -> None:
    episodes = races("1v0", 2, seconds=5.0)
    world = episodes.world
    foresight = Foresight(world, world.car, 2, 3, prior())
    foresight.begin(Scene(world, *everybody(world)), 15)
    rng = np.random.default_rng(1)
    for _ in range(15):
        actions = np.array([0.5, 0.0]) + rng.uniform(-0.2, 0.2, (2, 1, 2))
        read = foresight.step(np.repeat(actions[:, 0], 3, axis=0), {"speed", "lateral"})
        world.step(actions)
        assert read["lateral"].reshape(2, 3).tolist() == [[x] * 3 for x in world.state["lateral"][:, 0]]


def test_rivals_go_where_they_would_if_the_policy_drove_them() -> None:
    world = races("1v1", 4, seconds=5.0).world
    policy, (where, cars) = load_policy(str(CHECKPOINT), CIRCUIT, CAR), everybody(world)
    first = cars == 0
    foresight = Foresight(world, world.car, 4, 1, prior())
    foresight.begin(Scene(world, where[first], cars[first]), 15)
    for _ in range(15):
        seen = world.observe(policy.observation_spec, where, cars)
        actions, _ = policy.act(seen, policy.initial_memory(len(seen)))
        read = foresight.step(actions[first], {"nearest"})
        world.step(actions.reshape(4, 2, 2))
        apart = np.hypot(*(np.diff(world.state[axis], axis=1)[:, 0] for axis in ("x", "y")))
        np.testing.assert_allclose(read["nearest"], apart, atol=1e-3)


def test_a_rival_is_touched_where_it_is() -> None:
    episodes = races("1v1", 1, seconds=5.0)
    world = episodes.world
    state = world.state[0]
    # The other car right behind, faster by 20 m/s.
    state[1] = state[0]
    back = np.array([state["progress"][0] - 12.0])
    x, y, heading = world.track.pose(back, state["lateral"][:1])
    for name, value in (("x", x), ("y", y), ("yaw", heading), ("progress", back)):
        state[name][1:] = value
    state["velocity_x"][1] += 20.0
    state["world_velocity_x"][1] += 20.0 * np.cos(heading[0])
    state["world_velocity_y"][1] += 20.0 * np.sin(heading[0])
    foresight = Foresight(world, world.car, 1, 1, prior())
    foresight.begin(Scene(world, np.array([0]), np.array([0])), 5)
    gaps, touching = [], []
    for _ in range(5):
        read = foresight.step(np.array([[0.3, 0.0]]), {"gap_behind", "touching"})
        gaps.append(read["gap_behind"][0])
        touching.append(read["touching"][0])
    assert np.diff(gaps[:3]) == pytest.approx([-2.0, -2.0], abs=0.4)
    assert touching[0] == 0.0
    assert max(touching) == 1.0


def test_it_races_against_others(tmp_path: Path) -> None:
    short = tmp_path / "short.toml"
    shipped = DATA / "scenarios" / "braking_duel.toml"
    short.write_text(re.sub(r"time_s = .*", "time_s = 1.0", shipped.read_text()))
    name = source("-out")
    entrant = enter(name, CIRCUIT, CAR)
    seats = (Seat(0), Seat(1))
    match = Match(
        "test", "short", str(short), CIRCUIT, CAR,
        (entrant.id, "driver"), (name, "driver"), (Race(1, seats),), entrant.world,
    )  # fmt: skip
    policies = [load_policy(name, CIRCUIT, CAR), load_policy("driver", CIRCUIT, CAR)]
    first, second = (run_match(match, policies) for _ in range(2))
    assert first.equals(second)
    assert first["ending"].to_list() == ["time_up", "time_up"]


def test_it_is_known_by_checkpoint_and_objective() -> None:
    assert policy_id(source("-kerb-out")) == policy_id(source("-kerb - out"))
    assert policy_id(source("-kerb")) != policy_id(source("-out"))
    entrant = enter(source("-kerb"), CIRCUIT, CAR)
    assert entrant.algorithm.startswith("MPPI around ")
    assert list(weights([source("-kerb")])) == [CHECKPOINT]


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("mppi:nowhere.safetensors?objective=-kerb", r"nowhere\.safetensors"),
        (f"mppi:{CHECKPOINT}", "expected mppi:CHECKPOINT.safetensors.objective=EXPRESSION"),
        (source("-kerbs"), "objective: column 2: 'kerbs' is no quantity, expected one like kerb"),
        (source("speed"), "objective: column 1: the expression is in m/s, expected a pure number"),
        (source("-contacts"), "objective: column 2: 'contacts' is no quantity"),
    ],
)
def test_what_cannot_be_planned_is_refused_in_a_sentence(name: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        enter(name, CIRCUIT, CAR)


def test_a_checkpoint_that_is_missing_is_missed_before_anything_is_loaded() -> None:
    with pytest.raises(InputError, match=r"nowhere\.safetensors: no such file"):
        find_sources(["mppi:nowhere.safetensors?objective=-kerb"])
    assert find_sources([source("-kerb")]) == [source("-kerb")]


def test_it_cannot_act_without_a_world_nor_in_a_composite(tmp_path: Path) -> None:
    policy = load_policy(source("-kerb"), CIRCUIT, CAR)
    size = policy.observation_spec.size
    with pytest.raises(InputError, match="plans in the world itself"):
        policy.act(np.zeros((1, size), np.float32), policy.initial_memory(1))
    file = tmp_path / "two.toml"
    file.write_text(f'name = "two"\n[[part]]\npolicy = "{source("-kerb")}"\n')
    with pytest.raises(InputError, match="expected a file of weights, a driver or a plugin"):
        load_policy(str(file), CIRCUIT, CAR)
