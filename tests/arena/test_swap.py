"""Another driver at the wheel of a car: nothing else changes until it does something else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.arena.match import Match, Swap
from nathlon.arena.recorder import Recorded, record_races
from nathlon.arena.runner import run_match
from nathlon.arena.team import Absent
from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.load import load_policy
from nathlon.policies.policy import Batch, Policy
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.world import World
from tests.arena.test_recorder import CHASE, Steady, match_on
from tests.support.checkpoints import BUNDLED

CAR = 1
SOURCES = ("a", "b", "c")


@pytest.fixture(scope="module")
def match(tmp_path_factory: pytest.TempPathFactory) -> Match:
    """Two races of two cars a policy, that see late and act at unlike rates; the third has no seat."""
    facts = {"time_s": "6.0", "laps": "1", "start": '{kind = "grid"}'}
    late = {"action_hz": "[10, 20, 10, 20]", "perception_delay_s": "[0.1, 0.1, 0, 0.2]"}
    match = match_on(tmp_path_factory.mktemp("swap"), 4, facts | late, races=2)
    return replace(match, entrants=SOURCES, sources=SOURCES)


@pytest.fixture(scope="module")
def networks() -> list[Policy]:
    return [load_checkpoint(path) for path in BUNDLED[:2]]


def states(match: Match, policies: list[Policy | Absent]) -> dict[float, NDArray[np.void]]:
    """All that changes in the world, by time."""
    seen: dict[float, NDArray[np.void]] = {}

    def keep(world: World) -> None:
        seen[float(world.time[0])] = world.state.copy()

    run_match(match, policies, keep)
    return seen


def alike(one: NDArray[np.void], other: NDArray[np.void]) -> bool:
    # Between the fields lie bytes that say nothing.
    return all(one[name].tobytes() == other[name].tobytes() for name in one.dtype.names or ())


def test_the_same_policy_drives_the_same_race_to_the_bit(match: Match, networks: list[Policy]) -> None:
    again = load_checkpoint(BUNDLED[1])
    original = states(match, [*networks, again])
    for from_s in (0.0, 2.0):
        twin = states(replace(match, swap=Swap(0, CAR, 2, from_s)), [*networks, again])
        assert list(twin) == list(original)
        assert all(alike(twin[time_s], state) for time_s, state in original.items())


def test_another_policy_changes_nothing_before_its_moment(match: Match, networks: list[Policy]) -> None:
    original = states(match, [*networks, Steady(-1.0)])
    twin = states(replace(match, swap=Swap(0, CAR, 2, 2.0)), [*networks, Steady(-1.0)])
    same = {time_s: alike(twin[time_s], state) for time_s, state in original.items() if time_s in twin}
    until = max(time_s for time_s, known in same.items() if known)
    assert until == pytest.approx(2.0), "the first step that it decides is the one from 2 s"
    assert all(known for time_s, known in same.items() if time_s <= until)
    assert not any(known for time_s, known in same.items() if time_s > until)
    late = twin[max(twin)]
    assert late["velocity_x"][0, CAR] < original[max(twin)]["velocity_x"][0, CAR] - 5.0, "it brakes"
    assert alike(late[1], original[max(twin)][1]), "the match's other race goes on as it did"


class Counting:
    """Remembers how often it was asked, and steers by it."""

    observation_spec = ObservationSpec(course_points=2)

    def initial_memory(self, n: int) -> Batch:
        return np.zeros((n, 1), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        return np.concatenate([np.full_like(memory, 0.5), memory / 1000.0], axis=1), memory + 1.0


def test_its_memory_is_fresh_when_it_takes_over(tmp_path: Path) -> None:
    match = match_on(tmp_path, 2, {"time_s": "4.0", "laps": "1", "start": CHASE})
    match = replace(match, entrants=SOURCES, sources=SOURCES, swap=Swap(0, 0, 2, 2.0))
    wheel: dict[float, float] = {}

    def keep(world: World) -> None:
        wheel[round(float(world.time[0]), 3)] = float(world.state["steering"][0, 0])

    run_match(match, [Steady(0.5), Steady(0.5), Counting()], keep)
    assert wheel[2.1] == 0.0, "it has asked for none yet"
    assert 0.0 < wheel[2.3] < 0.005


@pytest.mark.parametrize("cause", ["absent", "raises"])
def test_one_that_fails_is_out_with_its_car_alone(match: Match, cause: str) -> None:
    class Raising(Steady):
        def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
            raise RuntimeError

    failing: Policy | Absent = Absent("policy_raised") if cause == "absent" else Raising(0.5)
    results = run_match(replace(match, swap=Swap(0, CAR, 2, 2.0)), [Steady(0.3), Steady(0.4), failing])
    out = results.filter(results["ending"] == "policy_raised")
    assert out.select("race", "car").rows() == [(0, CAR)]
    assert out["driven_s"].item() == pytest.approx(2.0)


def test_a_fault_of_the_one_before_is_not_laid_to_the_car(match: Match) -> None:
    class Faulty(Steady):
        asked = 0

        def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
            Faulty.asked += 1
            if Faulty.asked > 60:
                raise RuntimeError
            return super().act(observations, memory)

    results = run_match(replace(match, swap=Swap(0, CAR, 2, 1.0)), [Steady(0.3), Faulty(0.4), Steady(0.2)])
    out = results.filter(results["ending"] == "policy_raised")
    assert out.select("race", "car").rows() == [(0, 3), (1, 1), (1, 3)]


def test_the_car_goes_on_when_those_of_the_one_before_are_out(match: Match) -> None:
    class Lost(Steady):
        asked = 0

        def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
            actions, memory = super().act(observations, memory)
            Lost.asked += 1
            if Lost.asked > 60:
                actions[:] = np.nan
            return actions, memory

    driver = load_policy("driver", match.circuit, match.car)
    results = run_match(replace(match, swap=Swap(0, CAR, 2, 2.0)), [Steady(0.3), Lost(0.4), driver])
    out = results.filter(results["ending"] == "illegal_action")
    assert out.select("race", "car").rows() == [(0, 3), (1, 1), (1, 3)]
    [driven] = results.filter((results["race"] == 0) & (results["car"] == CAR))["driven_s"]
    assert driven == pytest.approx(6.0, abs=0.1)


def test_a_swap_is_part_of_the_key(match: Match) -> None:
    swapped = [replace(match, swap=Swap(0, CAR, 2, from_s)) for from_s in (0.0, 1.0)]
    assert len({match.key, *(one.key for one in swapped)}) == 3
    assert "swap" not in match.spec(), "keys of matches without one are as ever"


def test_what_each_driver_saw_is_what_it_was_given(match: Match) -> None:
    class Noting(Steady):
        def __init__(self, throttle: float, points: int) -> None:
            super().__init__(throttle)
            self.observation_spec = ObservationSpec(course_points=points)
            self.given: list[Batch] = []

        def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
            self.given.append(observations.copy())
            return super().act(observations, memory)

    first, second = Noting(0.5, 3), Noting(0.6, 5)
    swapped = replace(match, swap=Swap(0, CAR, 2, 2.0))
    recorded: Recorded = record_races(swapped, [Steady(0.4), first, second], [0], "abc", seen_by=CAR)
    before, after = recorded.seen
    assert recorded.logs[0].names == ("a", "c from 2 s", "a", "b")
    assert (before.spec, after.spec) == (first.observation_spec, second.observation_spec)
    assert before.time_s[-1] < 2.0 <= after.time_s[0] + 1e-6
    mean, deviation = after.spec.scaling
    # The batch holds cars 1 and 3 of both races; all four act at 20 Hz.
    given = np.stack([batch[0] for batch in second.given[: len(after.time_s)]])
    np.testing.assert_array_equal(after.numbers, given * deviation + mean)
    given = np.stack([batch[0] for batch in first.given[: len(before.time_s)]])
    mean, deviation = before.spec.scaling
    np.testing.assert_array_equal(before.numbers, given * deviation + mean)
