"""What counts as a failure, the moments from which it is tried again, and which of them are drawn."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from nathlon.policies.load import load_policy
from nathlon.policies.training.failures import EARLIEST_S, KINDS, Failures
from nathlon.policies.training.mistakes import out_of_control
from nathlon.sim.episode import Episodes

RACES = 4


def races(scenario: str = "slipstream_pass") -> Episodes:
    episodes = Episodes("lindenring", "gt3", scenario, RACES)
    episodes.start(range(RACES), [np.random.default_rng(race) for race in range(RACES)])
    return episodes


def watched(episodes: Episodes, seed: int = 0) -> Failures:
    """The second car of each race."""
    return Failures(episodes, np.arange(RACES), np.ones(RACES, np.int64), np.random.default_rng(seed))


def drive(episodes: Episodes, failures: Failures, steps: int, astray: int, at: int) -> None:
    """Have a driver drive all cars, but the second of race `astray` to the left from step `at` on."""
    policy = load_policy("driver:pace=0.7", "lindenring", "gt3")
    view = episodes.watch(policy.observation_spec, *(part.ravel() for part in np.indices((RACES, 2))))
    view.look(episodes.world)
    memory = policy.initial_memory(2 * RACES)
    for step in range(steps):
        action, memory = policy.act(view.seen, memory)
        moves = action.reshape(RACES, 2, 2).copy()
        if step >= at:
            moves[astray, 1] = [0.5, 0.2]
        episodes.step(moves)
        failures.watch()


@pytest.mark.parametrize("seed", range(5))
def test_who_leaves_the_road_tries_again_from_before(seed: int) -> None:
    episodes = races()
    failures = watched(episodes, seed)
    drive(episodes, failures, 125, astray=2, at=100)
    drawn = failures.draw(3)
    assert {failure.race for failure in drawn} == {2}
    for failure in drawn:
        assert not out_of_control(failure.moment.state[1])
        assert 12.5 - 2.5 - EARLIEST_S - 1.0 < failure.moment.arrays.ticks / 60.0 < 12.5


def test_tries_begin_long_and_short_before() -> None:
    ages = []
    for seed in range(12):
        episodes = races()
        failures = watched(episodes, seed)
        drive(episodes, failures, 90, astray=1, at=200)
        episodes.world.state["contacts_at_fault"][1, 1] += 1
        failures.watch()
        [failure] = failures.draw(1)
        ages.append(9.1 - float(failure.moment.arrays.ticks) / 60.0)
    assert 0.0 < min(ages) < 2.0
    assert EARLIEST_S - 2.0 < max(ages) < EARLIEST_S + 1.0


def test_nothing_is_tried_again_where_nothing_went_wrong() -> None:
    episodes = races()
    failures = watched(episodes)
    drive(episodes, failures, 30, astray=0, at=30)
    episodes.world.state["contacts_at_fault"][:, 0] += 1  # not the watched cars
    failures.watch()
    assert failures.draw(4) == []


def test_who_is_astray_already_does_not_try_again_from_there() -> None:
    episodes = races()
    episodes.world.state["heading_error"] = 3.0
    failures = watched(episodes)
    episodes.world.state["contacts_at_fault"] += 1
    failures.watch()
    assert failures.draw(4) == []


def test_kinds_are_drawn_by_what_they_cost_and_none_twice_before_all() -> None:
    episodes = races()
    failures = watched(episodes)
    state = episodes.world.state
    state["contacts_at_fault"][[0, 1], 1] += 1
    failures.watch()
    assert Counter(failure.race for failure in failures.draw(6)) == {0: 3, 1: 3}
    state["velocity_x"][2, 1], state["velocity_y"][2, 1] = 20.0, 20.0
    failures.watch()
    state["off_course"][3, 1], state["out_s"][3, 1] = True, 0.5
    failures.watch()
    drawn = Counter(failure.race for failure in failures.draw(6000))
    share = {"contact": drawn[0] + drawn[1], "spin": drawn[2], "off_course": drawn[3]}
    for kind, weight in KINDS.items():
        assert share[kind] / 6000 == pytest.approx(weight / sum(KINDS.values()), abs=0.03)
