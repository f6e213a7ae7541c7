"""Passes are found where the closed form says that they are, and nothing else counts as one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.arena.passes import Pass, passes
from nathlon.arena.race_log import RaceLog
from nathlon.results.summary import Clip
from nathlon.selection.publish.clips import clips
from tests.support.race_logs import LAP_M, STRAIGHT_M, oval_point, oval_race

TIME_S = np.arange(600) / 10.0


def race(distance: NDArray[np.float64], **columns: NDArray[np.generic]) -> RaceLog:
    """Two cars side by side that have come so far, (600, 2), in a minute."""
    log = oval_race(cars=2, duration_s=60.0)
    samples = log.samples.copy()
    samples["x_m"], samples["y_m"], samples["yaw_rad"] = oval_point(distance, np.array([2.5, -2.5]))
    samples["distance_m"] = distance - distance[0]
    samples["place"] = 1 + np.argsort(np.argsort(-distance, axis=1), axis=1)
    samples["velocity_x_m_s"] = np.gradient(distance, 0.1, axis=0)
    samples["driving"], samples["penalty_s"], samples["off_course"] = True, 0.0, False
    for name, column in columns.items():
        samples[name] = column
    return replace(log, samples=samples, incidents=())


def chase(meet_s: float, start_m: float = 0.0) -> NDArray[np.float64]:
    """The second car, 1 m/s faster than the 40 m/s of the first, is beside it at a moment."""
    first = start_m + 40.0 * TIME_S
    return np.stack([first, first + TIME_S - meet_s], axis=1)


def at(column: NDArray[np.generic] | bool, seconds: float, car: int) -> NDArray[np.bool_]:
    """True for one car at one moment."""
    flags = np.zeros((600, 2), bool)
    flags[round(10 * seconds), car] = column
    return flags


def test_the_faster_car_goes_by_where_the_two_meet() -> None:
    """With the line at the middle of the south straight, 30 s at 40 m/s is 1,200 m along a lap of 1,303."""
    [one] = passes(race(chase(30.05)))
    x, y, _ = oval_point(np.array(30.1 * 40.0 + 0.05), -2.5)
    assert (one.car, one.passed, one.place, one.stands) == (1, 0, 1, True)
    assert one.time_s == pytest.approx(30.1)
    assert (one.x_m, one.y_m) == pytest.approx((float(x), float(y)))
    assert one.section == -1


def test_the_section_is_that_of_the_lap_wherever_the_race_began() -> None:
    """The second section is the straight on the far side, around half a lap."""
    for start_m in (0.0, -20.0, 0.9 * LAP_M):
        far = (LAP_M / 2 - start_m) % LAP_M
        [one] = passes(race(chase(far / 40.0 + 0.05, start_m)))
        assert one.section == 1, start_m
    begin = LAP_M / 2 + STRAIGHT_M / 2 + 5.0
    assert [one.section for one in passes(race(chase(begin / 40.0)))] == [-1]


def test_who_comes_by_again_undoes_it_and_a_moment_ahead_is_no_pass() -> None:
    beside = 40.0 * TIME_S
    swing = np.stack([beside, beside + 5.0 * np.sin((TIME_S - 15.05) * np.pi / 10.0)], axis=1)
    found = passes(race(swing))
    assert [(round(one.time_s, 1), one.car, one.stands) for one in found] == [
        (15.1, 1, False),
        (25.1, 0, False),
        (35.1, 1, False),
        (45.1, 0, False),
        (55.1, 1, True),
    ]
    flicker = np.stack([beside, beside + 5.0 * np.sin((TIME_S - 15.05) * np.pi)], axis=1)
    assert passes(race(flicker)) == ()


@pytest.mark.parametrize(
    ("meet_s", "columns"),
    [
        (8.05, {}),
        (30.05, {"off_course": at(True, 28.0, 0)}),
        (30.05, {"penalty_s": 3.0 - 0.1 * at(True, 29.0, 0).cumsum(axis=0)}),
        (30.05, {"velocity_x_m_s": np.stack([np.full(600, 10.0), np.full(600, 41.0)], axis=1)}),
        (30.05, {"driving": np.stack([TIME_S < 20.0, TIME_S >= 0.0], axis=1)}),
    ],
    ids=["at the start", "off course", "serving", "crawling", "out"],
)
def test_a_place_that_is_given_away_is_no_pass(
    meet_s: float, columns: dict[str, NDArray[np.generic]]
) -> None:
    assert passes(race(chase(meet_s), **columns)) == ()


def test_the_car_that_passes_may_have_been_off_course() -> None:
    assert len(passes(race(chase(30.05), off_course=at(True, 28.0, 1)))) == 1


def test_a_pass_on_the_line_counts_though_nobody_drives_on() -> None:
    until = np.repeat((TIME_S < 31.0)[:, None], 2, axis=1)
    assert isinstance(passes(race(chase(30.05), driving=until))[0], Pass)


def test_clips_are_the_decisive_pass_and_the_hardest_contacts() -> None:
    log = race(chase(30.05))
    contact = oval_race(cars=2).incidents[0]
    incidents = tuple(
        replace(contact, time_s=time_s, fault=fault, closing_m_s=closing, text=f"contact {time_s:g}")
        for time_s, fault, closing in (
            (3.0, -1, 8.0),
            (20.0, -1, 5.0),
            (40.0, 0, 9.0),
            (57.0, 1, 12.0),
            (50.0, 0, 11.0),
        )
    )
    assert clips(replace(log, incidents=incidents)) == [
        Clip(0.0, 7.0, 0, "the hardest contact that nobody is blamed for: contact 3"),
        Clip(24.1, 34.1, 1, "the pass for place 1: 2 entrant b goes by 1 entrant a"),
        Clip(51.0, 59.9, 0, "the hardest contact that a driver is blamed for: contact 57"),
    ]


def test_light_touches_passes_that_were_undone_and_passes_in_a_team_are_no_clips() -> None:
    beside = 40.0 * TIME_S
    undone = np.stack(
        [beside, beside + 5.0 * np.sin((np.minimum(TIME_S, 40.0) - 20.05) * np.pi / 15.0)], axis=1
    )
    touch = replace(oval_race(cars=2).incidents[0], fault=-1, closing_m_s=0.9)
    assert [one.car for one in passes(race(undone))] == [1, 0]
    assert [clip.car for clip in clips(replace(race(undone), incidents=(touch,)))] == [0]
    assert clips(replace(race(undone), teams=(1, 1))) == []
    assert clips(replace(oval_race(cars=1), incidents=())) == []
