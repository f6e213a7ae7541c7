"""Matches: keys, faults, determinism, classification."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from nathlon.arena.classification import BLANK, classify
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.results import RESULTS
from nathlon.arena.runner import run_match
from nathlon.policies.driver import Driver
from nathlon.policies.policy import Batch, Policy
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.world import World

DRIVER = "driver"
SLOW = "driver:pace=0.85"


class Coasting:
    """Drives off gently; what it returns can be spoilt from a given tick on."""

    observation_spec = ObservationSpec(course_points=4)

    def __init__(self, spoil: str = "", after: int = 0) -> None:
        self._spoil, self._after, self._calls = spoil, after, 0

    def initial_memory(self, n: int) -> Batch:
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        actions = np.zeros((len(observations), 2), np.float32)
        actions[:, 0] = 0.3
        self._calls += 1
        if self._calls > self._after:
            match self._spoil:
                case "raises":
                    raise RuntimeError("no more")
                case "nan":
                    actions[0] = np.nan
                case "shape":
                    actions = actions[:, :1]
                case "type":
                    return [[0.0, 0.0]] * len(observations), memory  # type: ignore[return-value]
                case "huge":
                    actions[:] = 1e30
        return actions, memory


def sprint(*entrants: str, seats: tuple[int, ...], races: int = 1) -> Match:
    """A match on the shortest scenario with two cars."""
    taken = tuple(Seat(entrant) for entrant in seats)
    return Match(
        "race",
        "slipstream_pass",
        "slipstream_pass",
        "lindenring",
        "gt3",
        entrants,
        entrants,
        tuple(Race(seed, taken) for seed in range(races)),
    )


def drivers() -> list[Policy]:
    return [Driver("lindenring", "gt3"), Driver("lindenring", "gt3", pace=0.85)]


def test_results_are_typed_and_the_first_to_finish_is_placed_first() -> None:
    results = run_match(sprint(DRIVER, SLOW, seats=(0, 1), races=3), drivers())
    assert results.schema == RESULTS
    assert results.height == 6
    assert (results["ending"] == "finished").all()
    winners = results.filter(pl.col("place") == 1)
    assert set(winners["entrant"]) == {DRIVER}
    assert set(winners["points"]) == {10.0}
    assert set(results.filter(pl.col("place") == 2)["points"]) == {8.0}
    # From 30 to 40 m into the straight of 958.6 m to 130 m past its end, the second from 13 to 15 m behind;
    # a race is over within the last step, of up to 6 m.
    assert results["distance_m"].is_between(1048.6, 1073.6 + 6.0).all()


def test_only_cars_of_those_who_know_a_reverse_gear_have_one() -> None:
    fitted: list[list[bool]] = []

    def look(world: World) -> None:
        fitted.append(world.state["has_reverse"][0].tolist())

    run_match(sprint(DRIVER, "coasting", seats=(1, 0)), [Driver("lindenring", "gt3"), Coasting()], look)
    assert all(each == [False, True] for each in fitted)


def test_the_same_match_gives_the_same_bytes() -> None:
    match = sprint(DRIVER, SLOW, seats=(1, 0), races=2)
    assert run_match(match, drivers()).equals(run_match(match, drivers()))


@pytest.mark.parametrize(
    ("spoil", "ending"),
    [
        ("raises", "policy_raised"),
        ("nan", "illegal_action"),
        ("shape", "illegal_action"),
        ("type", "illegal_action"),
    ],
)
def test_a_faulty_policy_loses_and_the_others_go_on(spoil: str, ending: str) -> None:
    match = sprint("faulty", SLOW, seats=(0, 1))
    results = run_match(match, [Coasting(spoil, after=20), drivers()[1]])
    faulty, other = results.sort("car").iter_rows(named=True)
    assert faulty["ending"] == ending
    assert faulty["place"] == 2
    assert faulty["driven_s"] == pytest.approx(2.0, abs=0.11)
    assert other["ending"] == "finished"
    assert other["place"] == 1


def test_whom_its_own_policy_let_down_is_last_however_far_it_came() -> None:
    cars = np.full((1, 3), BLANK)
    cars["progress"], cars["finish_s"] = [[900.0, 500.0, 100.0]], [[np.nan, np.nan, 12.0]]
    endings = np.array([["policy_raised", "stuck", "finished"]])
    results = classify(sprint(DRIVER, SLOW, seats=(0, 1, 1)), cars, endings, np.zeros((1, 3)))
    assert results["place"].to_list() == [3, 2, 1]


def test_a_nan_ends_only_the_car_that_it_was_meant_for() -> None:
    match = sprint("faulty", SLOW, seats=(0, 0))
    results = run_match(match, [Coasting("nan", after=5), drivers()[1]]).sort("car")
    assert results["ending"][0] == "illegal_action"
    assert results["ending"][1] != "illegal_action"


def test_huge_actions_are_clipped_not_fatal() -> None:
    results = run_match(sprint("huge", seats=(0, 0)), [Coasting("huge")])
    assert not set(results["ending"]) & {"policy_raised", "illegal_action"}


def test_the_key_names_all_that_decides_the_outcome() -> None:
    match = sprint(DRIVER, SLOW, seats=(1, 0))
    same = replace(match, sources=("elsewhere", SLOW))
    assert same.key == match.key
    different = [
        replace(match, entrants=(SLOW, DRIVER)),
        replace(match, races=(replace(match.races[0], seed=9),)),
        replace(match, races=match.races * 2),
        replace(match, scenario="1v1"),
    ]
    assert len({match.key, *(other.key for other in different)}) == 5
