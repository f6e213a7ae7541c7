"""Starts from shortly before a mistake: what a mistake is, and that races go on exactly from a moment."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.policies.load import load_policy
from nathlon.policies.training.mistakes import CAPACITY, Mistakes, out_of_control
from nathlon.sim.episode import Episodes
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.scenario import Scenario, load_scenario
from nathlon.sim.state import CAR_STATE

SPEC = ObservationSpec(course_points=2)
RACES = 3


def scenario(delay_s: float = 0.0) -> Scenario:
    return load_scenario("1v1").model_copy(update={"perception_delay_s": delay_s})


def started(delay_s: float = 0.0) -> Episodes:
    episodes = Episodes("lindenring", "gt3", scenario(delay_s), RACES)
    episodes.watch(SPEC, *(part.ravel() for part in np.indices((RACES, 2))))
    start(episodes, list(range(RACES)))
    return episodes


def start(episodes: Episodes, races: list[int]) -> None:
    episodes.start(races, [np.random.default_rng(race) for race in races])


def actions(step: int) -> NDArray[np.float32]:
    """Some driving that ends off the road."""
    return np.random.default_rng(step).uniform([0.2, -0.2], [1.0, 0.3], (RACES, 2, 2)).astype(np.float32)


def bits(episodes: Episodes, race: int) -> list[bytes]:
    return [array[race].tobytes() for array in episodes.world.arrays()]


def test_a_race_goes_on_from_a_moment_bit_for_bit() -> None:
    episodes = started()
    for step in range(25):
        episodes.step(actions(step))
    moment = episodes.moment().of(1)
    expected = []
    for step in range(25, 60):
        episodes.step(actions(step))
        expected.append((bits(episodes, 1), episodes.endings[1].copy()))
    # In another world, and in another race's place.
    other = started()
    other.start([2], [np.random.default_rng(9)], {2: moment})
    for step in range(25, 60):
        moved = actions(step)
        moved[2] = moved[1]
        other.step(moved)
        arrays, endings = expected[step - 25]
        assert bits(other, 2) == arrays
        assert other.endings[2].tolist() == endings.tolist()


def test_a_moment_does_not_change_with_the_race() -> None:
    episodes = started()
    moments = episodes.moment(), episodes.moment().of(0)
    before = [array.tobytes() for array in (*moments[0].arrays, *moments[1].arrays)]
    episodes.step(actions(0))
    assert [array.tobytes() for array in (*moments[0].arrays, *moments[1].arrays)] == before


@pytest.mark.parametrize("delay_s", [0.15, 0.2])
def test_a_late_view_begins_with_the_moment(delay_s: float) -> None:
    episodes = Episodes("lindenring", "gt3", scenario(delay_s), RACES)
    view = episodes.watch(SPEC, np.arange(RACES), np.zeros(RACES, np.int64))
    start(episodes, list(range(RACES)))
    for step in range(12):
        episodes.step(actions(step))
    moment = episodes.moment().of(1)
    for step in range(12, 30):
        episodes.step(actions(step))
    others = view.seen[[0, 2]]
    episodes.start([1], [np.random.default_rng(0)], {1: moment})
    present = episodes.world.observe(SPEC, np.array([1]), np.array([0]))
    np.testing.assert_array_equal(view.seen[[1]], present)
    np.testing.assert_array_equal(view.seen[[0, 2]], others)
    episodes.step(actions(30))
    np.testing.assert_array_equal(view.seen[[1]], present)


@pytest.mark.parametrize(
    ("fields", "lost"),
    [
        ({"velocity_x": 50.0}, False),
        ({"velocity_x": 50.0, "off_course": True}, True),
        ({"velocity_x": 20.0, "velocity_y": -18.0}, True),
        ({"velocity_x": -20.0}, True),
        ({"velocity_x": 2.0, "velocity_y": 2.0}, False),
        ({"velocity_x": 30.0, "heading_error": -1.2}, True),
        ({"velocity_x": 30.0, "wall_contact": True}, True),
        ({"velocity_x": 3.0, "wall_contact": True}, False),
        ({"velocity_x": 50.0, "off_course": True, "driving": False}, False),
    ],
)
def test_out_of_control(fields: dict[str, float], lost: bool) -> None:
    car = np.zeros((), CAR_STATE)
    car["driving"] = True
    for name, value in fields.items():
        car[name] = value
    assert out_of_control(car) == lost


def drive_off(episodes: Episodes, mistakes: Mistakes, steps: int) -> list[int]:
    """Drive well for 8 s, then steer the cars of race 1 to the left; returns the steps that were mistakes."""
    policy = load_policy("driver:pace=0.7", "lindenring", "gt3")
    view = episodes.watch(policy.observation_spec, *(part.ravel() for part in np.indices((RACES, 2))))
    view.look(episodes.world)
    memory = policy.initial_memory(2 * RACES)
    noted = []
    for step in range(steps):
        action, memory = policy.act(view.seen, memory)
        moves = action.reshape(RACES, 2, 2).copy()
        if step >= 80:
            moves[1] = [0.5, 0.2]
        episodes.step(moves)
        known = len(mistakes)
        mistakes.watch()
        noted += [step] * (len(mistakes) - known)
    return noted


def test_the_moment_before_a_mistake_is_kept() -> None:
    episodes = Episodes("lindenring", "gt3", load_scenario("slipstream_pass"), RACES)
    start(episodes, list(range(RACES)))
    mistakes = Mistakes(episodes, np.array([1]))
    noted = drive_off(episodes, mistakes, 110)
    assert len(noted) == len(mistakes) == 1
    moment = mistakes.draw(np.random.default_rng(0))
    assert not out_of_control(moment.state).any()
    age_s = (noted[0] + 1) * 0.1 - moment.arrays.ticks / 60.0
    assert 3.0 < round(float(age_s), 6) <= 4.0


def test_a_mistake_soon_after_the_start_has_no_moment_before() -> None:
    episodes = Episodes("lindenring", "gt3", load_scenario("slipstream_pass"), RACES)
    start(episodes, list(range(RACES)))
    mistakes = Mistakes(episodes, np.array([1]))
    drive_off(episodes, mistakes, 79)
    assert len(mistakes) == 0
    # The race begins anew; what was before its start does not belong to it.
    start(episodes, [1])
    mistakes.restart([1])
    episodes.world.state["off_course"][1] = True
    mistakes.watch()
    assert len(mistakes) == 0


def test_no_more_are_kept_than_there_is_room_for() -> None:
    episodes = Episodes("lindenring", "gt3", load_scenario("slipstream_pass"), RACES)
    start(episodes, list(range(RACES)))
    mistakes = Mistakes(episodes, np.array([0, 1]))
    for turn in range(40 + 2 * CAPACITY):
        episodes.world.state["off_course"] = turn >= 40 and turn % 2 == 0
        episodes.world.state["off_course"] &= turn % 10 != 9
        mistakes.watch()
    assert len(mistakes) == CAPACITY
