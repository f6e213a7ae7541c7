"""Causes: the first one is what most of the loss comes from, on laps that are made up metre by metre."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.lab.coach.diagnosis import ComparedParts, causes_of
from nathlon.lab.coach.edits import full_throttle
from nathlon.lab.coach.lap import Lap
from nathlon.lab.coach.parts import CoursePart, marks
from nathlon.lab.coach.shares import shares

LENGTH = 600
APEX_M, BRAKING_M_S2, PUSHING_M_S2 = 300, 10.0, 5.0
FASTEST, SLOWEST = 60.0, 25.0
BEND = CoursePart("Kehre", "corner", 100.0, 500.0, 0)
STRAIGHT = CoursePart("Gerade", "straight", 320.0, 600.0, 1)
Trace = NDArray[np.float64]


def driven(
    slowest: float = SLOWEST,
    fastest: float = FASTEST,
    early_m: float = 0.0,
    full_m: float = 0.0,
    push: float = PUSHING_M_S2,
    lateral_m: float = 0.0,
    aside: float = 0.0,
    pull: float = 20.0,
) -> Lap:
    """A lap of one bend.

    Args:
        slowest, fastest: speeds in the bend and at most, m/s.
        early_m: by how much braking begins and ends too early.
        full_m: after the slowest place, until when it coasts.
        push: acceleration on the way out, m/s².
        lateral_m: where the car is on the road.
        aside: share of a way that is longer.
        pull: acceleration to the side in the bend, m/s².
    """
    place = np.arange(LENGTH + 1.0)
    before = slowest**2 + 2.0 * BRAKING_M_S2 * np.maximum(APEX_M - early_m - place, 0.0)
    after = slowest**2 + 2.0 * push * np.maximum(place - APEX_M - full_m, 0.0)
    speed = np.minimum(np.sqrt(np.where(place < APEX_M, before, after)), fastest)
    braking = (before < fastest**2) & (place < APEX_M - early_m)
    pedal = np.where(
        braking, -0.8, np.where((place >= APEX_M - early_m) & (place < APEX_M + full_m), 0.2, 1.0)
    )
    pedal = np.where((place > APEX_M + full_m) & (push < PUSHING_M_S2), push / PUSHING_M_S2, pedal)
    time = np.concatenate([[0.0], np.cumsum((1.0 + aside) / (0.5 * (speed[1:] + speed[:-1])))])
    still = np.zeros(LENGTH + 1)
    return Lap(
        1, False, 0.0, time, speed, pedal, still, np.full(LENGTH + 1, lateral_m), still, still, still,
        np.gradient(speed) * speed, np.full(LENGTH + 1, pull), still.astype(np.int64) + 3,
        still.astype(np.bool_), still.astype(np.bool_),
    )  # fmt: skip


def compared(own: Lap, other: Lap, part: CoursePart = BEND) -> ComparedParts:
    """A part of two laps beside each other."""
    both = (marks(own, part.start_m, part), marks(other, part.start_m, part)) if part.bend else None
    return ComparedParts(own, other, part, both)


def kinds(own: Lap, part: CoursePart = BEND) -> list[str]:
    return [cause.kind for cause in causes_of(compared(own, driven(), part))]


def test_who_is_slower_everywhere_is_told_so_and_not_of_its_line() -> None:
    slow = driven(slowest=0.9 * SLOWEST, fastest=0.9 * FASTEST, lateral_m=2.0, pull=16.2)
    [first, *others] = causes_of(compared(slow, driven()))
    assert first.kind == "minimum_speed"
    assert first.own == pytest.approx(3.6 * 0.9 * SLOWEST)
    assert "line" not in [cause.kind for cause in others]


def test_a_bend_whose_slowest_place_is_at_its_end_has_its_speed_for_a_cause() -> None:
    first_half = CoursePart("Wiesen-S", "corner", 100.0, float(APEX_M), 0)
    slow = driven(slowest=0.9 * SLOWEST, lateral_m=1.5, pull=16.2)
    assert kinds(slow, first_half)[0] == "minimum_speed"


@pytest.mark.parametrize("early_m", [15.0, 30.0])
def test_who_brakes_early_is_told_so_first(early_m: float) -> None:
    assert kinds(driven(early_m=early_m))[0] == "braking_early"


def test_who_is_slower_in_the_bend_and_brakes_for_that_is_not_told_to_brake_later_first() -> None:
    assert kinds(driven(slowest=0.8 * SLOWEST, pull=13.0))[0] == "minimum_speed"


def test_who_is_late_on_the_throttle_is_told_so_first() -> None:
    assert kinds(driven(full_m=30.0))[0] == "throttle"


def test_who_comes_too_fast_and_leaves_slower_is_told_so_first() -> None:
    hasty = driven(early_m=-10.0, slowest=SLOWEST - 1.0, full_m=25.0)
    assert kinds(hasty)[0] in ("braking_late", "entry_speed")


def test_a_line_is_a_cause_where_it_is_longer_or_narrower_and_not_where_it_is_only_another() -> None:
    assert kinds(driven(lateral_m=2.0, aside=0.02))[0] == "line"
    narrower = driven(slowest=0.95 * SLOWEST, lateral_m=2.0)
    assert kinds(narrower)[0] == "line", "it has no more grip for it"
    assert "line" not in kinds(driven(lateral_m=2.0, early_m=20.0))


def test_a_straight_without_full_throttle_is_told_apart_from_a_slow_way_onto_it() -> None:
    lifts = driven(push=0.8 * PUSHING_M_S2)
    assert kinds(lifts, STRAIGHT)[0] == "lifting"
    assert kinds(driven(slowest=0.8 * SLOWEST), STRAIGHT) == ["exit_speed"]
    assert compared(lifts, driven(), STRAIGHT).improvable
    assert not compared(driven(), driven(), STRAIGHT).improvable
    edits = list(full_throttle(STRAIGHT, lifts))
    assert edits
    for edit in edits:
        assert edit.kind == "full_throttle"
        assert (edit.plan.pedal >= lifts.pedal).all()
        assert edit.plan.pedal[APEX_M + 50] == 1.0


def test_shares_add_up_to_what_is_lost() -> None:
    for own in (driven(early_m=20.0), driven(0.9 * SLOWEST, aside=0.01), driven(full_m=20.0)):
        found = shares(own, driven(), 100.0, float(APEX_M), 500.0)
        lost = own.between(100.0, 500.0) - driven().between(100.0, 500.0)
        assert sum(found) == pytest.approx(lost, abs=0.002)
