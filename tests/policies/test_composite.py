"""Composites: who drives where, exact hand-over, files and their errors."""

from __future__ import annotations

import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from nathlon.arena.entrance import trained_on
from nathlon.arena.entrant import enter
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.pool import Pool
from nathlon.arena.runner import run_match
from nathlon.policies.load import load_policy
from nathlon.policies.policy import Batch, Policy, has_reverse
from nathlon.policies.sources.composite import Composite, CompositePart, columns, joint_spec
from nathlon.policies.sources.finding import find_sources
from nathlon.sim.car import load_car
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ANY_CAR, PLANNED, ObservationSpec
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from tests.support.checkpoints import BUNDLED

CIRCUIT, CAR = "lindenring", "gt3"
TRACK = load_track(CIRCUIT)
WEIGHTS = str(BUNDLED[-1])
OTHER_WEIGHTS = str(BUNDLED[0])
BLIND = ObservationSpec(course_points=0, cars_ahead=0, cars_behind=0)


class Steady:
    """Always gives the same action, and counts in its memory how often it was asked."""

    observation_spec = BLIND

    def __init__(self, throttle: float) -> None:
        self.throttle = throttle

    def initial_memory(self, n: int) -> Batch:
        return np.zeros((n, 1), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        return np.full((len(observations), 2), self.throttle, np.float32), memory + np.float32(1.0)


def steady(*parts: CompositePart) -> Composite:
    """Parts of which the first gives 0.0, the next 0.1 and so on."""
    return Composite(TRACK, parts, [Steady(0.1 * index) for index in range(len(parts))], BLIND)


def seen_from(distances: NDArray[np.float64]) -> Batch:
    """Observations of cars that are so far along the centre line, m."""
    values = np.zeros((len(distances), BLIND.size))
    angle = 2 * np.pi * distances / TRACK.length
    values[:, BLIND.slice("progress")] = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    mean, deviation = BLIND.scaling
    return ((values - mean) / deviation).astype(np.float32)


def drives(composite: Composite, ticks: NDArray[np.float64]) -> NDArray[np.int64]:
    """Which part drives each of some cars at distances (ticks, cars), m."""
    memory = composite.initial_memory(ticks.shape[1])
    turns = []
    for distances in ticks:
        actions, memory = composite.act(seen_from(distances), memory)
        turns.append(np.round(10 * actions[:, 0]).astype(np.int64))
    return np.array(turns)


def relay(first: str, second: str, until_m: float) -> Policy:
    parts = [CompositePart(policy=first, until_m=until_m), CompositePart(policy=second)]
    policies = [load_policy(name, CIRCUIT, CAR) for name in (first, second)]
    spec = joint_spec([first, second], [policy.observation_spec for policy in policies])
    return Composite(TRACK, parts, policies, spec)


def raced(policy: Policy) -> pl.DataFrame:
    """Results of a short race of a policy against a slow driver."""
    rival = "driver:pace=0.85"
    races = (Race(0, (Seat(1), Seat(0))),)
    match = Match("race", "t", "slipstream_pass", CIRCUIT, CAR, ("own", rival), ("own", rival), races)
    return run_match(match, [policy, load_policy(rival, CIRCUIT, CAR)])


@cache
def alone(name: str) -> pl.DataFrame:
    return raced(load_policy(name, CIRCUIT, CAR))


def test_a_policy_that_takes_over_from_itself_drives_the_same_race_to_the_bit() -> None:
    for name in (WEIGHTS, "driver"):
        assert raced(relay(name, name, 400.0)).equals(alone(name))


def test_without_a_way_to_go_the_second_drives_and_without_an_end_the_first() -> None:
    # The driver sees one course point and the checkpoint sixteen: neither may notice the other.
    for name, composite in (
        ("driver", relay(WEIGHTS, "driver", 0.0)),
        (WEIGHTS, relay("driver", WEIGHTS, 0.0)),
        (WEIGHTS, relay(WEIGHTS, "driver", 1e6)),
    ):
        assert raced(composite).equals(alone(name))
    assert not raced(relay(WEIGHTS, "driver", 400.0)).equals(alone(WEIGHTS))


@settings(max_examples=50, deadline=None)
@given(
    start=st.floats(-200.0, 3 * TRACK.length),
    until=st.floats(0.0, 2.5 * TRACK.length),
    steps=st.lists(st.floats(-40.0, 400.0), max_size=60),
)
def test_the_first_part_drives_until_its_distance_from_the_start_and_never_again(
    start: float, until: float, steps: list[float]
) -> None:
    gone = np.concatenate([[0.0], np.cumsum(steps)])
    furthest = np.maximum.accumulate(gone)
    turns = drives(
        steady(CompositePart(policy="a", until_m=until), CompositePart(policy="b")), start + gone[:, None]
    )[:, 0]
    clear = np.abs(furthest - until) > 0.05
    assert (turns[clear] == (furthest >= until)[clear]).all()
    assert (np.diff(turns) >= 0).all()


def test_sections_hand_over_at_their_ends_and_back_lap_after_lap() -> None:
    begin, end = TRACK.stretch("last chicane")
    composite = steady(
        CompositePart(policy="a", sections=("last chicane", TRACK.sections[0].name)),
        CompositePart(policy="b"),
    )
    first = TRACK.sections[0]
    places = [begin - 1, begin + 1, end - 1, end + 1, first.start_m + 1, first.end_m - 1, first.end_m + 1]
    laps = np.array(places)[:, None] + TRACK.length * np.arange(3)
    assert (drives(composite, laps).T == [1, 0, 0, 1, 0, 0, 1]).all()


def test_conditions_of_a_part_hold_together_and_parts_are_asked_in_turn() -> None:
    begin, end = TRACK.stretch("last chicane")
    composite = steady(
        CompositePart(policy="a", until_m=end - begin + TRACK.length / 2, sections=("last chicane",)),
        CompositePart(policy="b", until_m=begin),
        CompositePart(policy="c"),
    )
    way = np.array([0.0, begin / 2, begin + 1, end + 1])
    assert drives(composite, way[:, None])[:, 0].tolist() == [1, 1, 2, 2]
    late = begin - 20.0
    assert drives(composite, np.array([[late], [begin + 1]]))[:, 0].tolist() == [1, 0]


def test_every_part_watches_all_the_time() -> None:
    composite = steady(CompositePart(policy="a", until_m=50.0), CompositePart(policy="b"))
    memory = composite.initial_memory(3)
    for distance in (0.0, 40.0, 80.0):
        _, memory = composite.act(seen_from(np.full(3, distance)), memory)
    assert memory.shape == (3, 4)
    assert memory.dtype == np.float32
    assert (memory[:, 2:] == 3.0).all()


@pytest.mark.parametrize("points", [0, 1, 16])
def test_a_part_sees_to_the_bit_what_it_would_see_alone(points: int) -> None:
    scenario = load_scenario("1v7")
    world = scenario.world(TRACK, load_car(CAR), 4)
    for race in range(4):
        world.reset(race, scenario.place(TRACK, np.random.default_rng(race)))
    races, cars = (index.ravel() for index in np.indices(world.state.shape))
    own = ObservationSpec(course_points=points, cars_ahead=2, cars_behind=4)
    joint = joint_spec(["a", "b"], [own, ObservationSpec(course_points=16, cars_ahead=3, cars_behind=1)])
    assert (joint.course_points, joint.cars_ahead, joint.cars_behind) == (16, 3, 4)
    seen = world.observe(joint, races, cars)[:, columns(joint, own)]
    assert np.array_equal(seen, world.observe(own, races, cars))


def test_policies_with_different_courses_cannot_be_joined() -> None:
    specs = [ObservationSpec(course_points=1), ObservationSpec(course_points=20), ObservationSpec()]
    with pytest.raises(InputError, match=r"^b sees 20 course points over 6 s, c 60 over 6 s, expected"):
        joint_spec(["a", "b", "c"], specs)


def test_a_layout_for_any_car_stays_one_and_goes_with_no_other() -> None:
    any_car, planned = (ObservationSpec(version=version, cars_ahead=1) for version in (ANY_CAR, PLANNED))
    for specs in ([any_car], [planned], [any_car, planned], [replace(planned, practised_by="a")]):
        joint = joint_spec(["a", "b"][: len(specs)], specs)
        assert joint == specs[-1]
        for spec in specs:
            assert len(columns(joint, spec)) == spec.size
    slower = replace(planned, plan_pace=0.9)
    for specs, said in (
        ([ObservationSpec(), any_car], "^a sees version 2 of the observations, b version 3 of the obs"),
        ([planned, replace(planned, practised_by="b")], "^b and a see plans that different policies have pr"),
        ([planned, slower], "^b sees version 4 .* with a plan at pace 0.9, a version 4 .* at pace 0.97"),
    ):
        with pytest.raises(InputError, match=said):
            joint_spec(["a", "b"], specs)


def test_without_a_place_a_composite_has_no_conditions() -> None:
    class Planning(Steady):
        observation_spec = ObservationSpec(version=PLANNED)

    spec = Planning.observation_spec
    composite = Composite(TRACK, [CompositePart(policy="a")], [Planning(0.3)], spec)
    actions, memory = composite.act(spec.blank(3), composite.initial_memory(3))
    assert actions.tolist() == np.full((3, 2), 0.3, np.float32).tolist()
    assert memory[:, -1].tolist() == [1.0] * 3
    parts = [CompositePart(policy="a", until_m=9.0), CompositePart(policy="b")]
    with pytest.raises(InputError, match=r"version 4 of the observations with a plan .* names no place"):
        Composite(TRACK, parts, [Planning(0.1)] * 2, spec)


def test_a_composite_has_a_reverse_gear_if_all_its_policies_have_one() -> None:
    class Backing(Steady):
        reverse = True

    class Planning(Steady):
        observation_spec = ObservationSpec(version=PLANNED)

    assert has_reverse(Planning(0.0))
    parts = [CompositePart(policy="a", until_m=1.0), CompositePart(policy="b")]
    for policies, reverse in (
        ([Backing(0.0), Backing(0.1)], True),
        ([Backing(0.0), Steady(0.1)], False),
    ):
        assert has_reverse(Composite(TRACK, parts, policies, BLIND)) is reverse


def written(folder: Path, text: str) -> str:
    path = folder / "relay.toml"
    path.write_text(text)
    return str(path)


RELAY = """
name = "relay"
[[part]]
policy = "weights/a.safetensors"
until_m = 300.0
[[part]]
policy = "driver:pace=0.95"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Holds the weights that RELAY names."""
    (tmp_path / "weights").mkdir()
    shutil.copy(WEIGHTS, tmp_path / "weights" / "a.safetensors")
    return tmp_path


def test_a_file_races_as_its_parts_would(folder: Path, pool: Pool) -> None:
    source = written(folder, RELAY)
    entrant = enter(source, CIRCUIT, CAR)
    assert (entrant.name, entrant.algorithm, entrant.source) == ("relay", "composite", source)
    races = (Race(0, (Seat(0), Seat(0))),)
    match = Match("race", "t", "slipstream_pass", CIRCUIT, CAR, (entrant.id,), (source,), races)
    same = run_match(match, [relay(WEIGHTS, "driver:pace=0.95", 300.0)])
    assert run_match(match, match_policies(match)).equals(same)
    assert trained_on(pool, [source]) == (CIRCUIT, CAR)


def test_the_id_stands_for_contents_and_not_for_paths(folder: Path) -> None:
    original = enter(written(folder, RELAY), CIRCUIT, CAR).id
    shutil.copy(WEIGHTS, folder / "b.safetensors")
    assert enter(written(folder, RELAY.replace("weights/a", "b")), CIRCUIT, CAR).id == original
    others = [RELAY.replace("300", "301"), RELAY.replace("0.95", "0.96")]
    ids = {enter(written(folder, text), CIRCUIT, CAR).id for text in others}
    shutil.copy(OTHER_WEIGHTS, folder / "weights" / "a.safetensors")
    ids.add(enter(written(folder, RELAY), CIRCUIT, CAR).id)
    assert len(ids | {original}) == 4


def test_parts_for_other_circuits_stand_aside(folder: Path) -> None:
    shutil.copy(
        next((BUNDLED[0].parents[1] / "porto-sereno").glob("*.safetensors")), folder / "other.safetensors"
    )
    elsewhere = '[[part]]\npolicy = "other.safetensors"\ncircuit = "porto-sereno"\n'
    source = written(folder, RELAY.replace("[[part]]", elsewhere + "[[part]]", 1))
    assert enter(source, CIRCUIT, CAR).algorithm == "composite"
    composite = load_policy(source, CIRCUIT, CAR)
    observations = np.zeros((2, composite.observation_spec.size), np.float32)
    same = relay(WEIGHTS, "driver:pace=0.95", 300.0)
    for policy in (composite, same):
        assert policy.initial_memory(2).shape == (2, 4)
    own, expected = (policy.act(observations, policy.initial_memory(2))[0] for policy in (composite, same))
    assert np.array_equal(own, expected)


def test_a_folder_does_not_stand_for_its_composites(folder: Path) -> None:
    source = Path(written(folder, RELAY))
    assert find_sources([folder]) == [str(folder / "weights" / "a.safetensors")]
    assert find_sources([source]) == [str(source)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (RELAY.replace('name = "relay"', ""), r"relay.toml: field name: Field required"),
        ('name = "relay"', r"relay.toml: field part: Field required"),
        (RELAY.replace("300.0", "-1.0"), r"relay.toml: field part.0.until_m is -1.0"),
        (
            RELAY + "until_m = 9.0",
            r"relay.toml: part: nobody drives everywhere on lindenring, expected a last",
        ),
        (RELAY + 'circuit = "porto-sereno"', r"relay.toml: part: nobody drives everywhere on lindenring"),
        (RELAY.replace("until_m = 300.0", 'sections = ["Nowhere"]'), r"relay.toml: sections: .* 'Nowhere'"),
        (RELAY.replace("a.safetensors", "c.safetensors"), r"c.safetensors: cannot .*: No such file"),
        (RELAY.replace("weights/a.safetensors", "relay.toml"), r"policy is 'relay.toml', expected a file"),
    ],
)
def test_a_wrong_file_is_one_sentence(folder: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        enter(written(folder, text), CIRCUIT, CAR)
    assert "\n" not in str(caught.value)


def test_a_part_must_have_been_trained_here(folder: Path) -> None:
    with pytest.raises(InputError, match=r"a.safetensors: circuit is 'lindenring', expected 'porto-sereno'"):
        enter(written(folder, RELAY), "porto-sereno", CAR)
