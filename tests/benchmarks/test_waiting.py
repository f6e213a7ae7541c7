"""Which passes on a straight count, and which of them are lost again."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.waiting import NOTED, SORTED_S, Trace, changes, passes_on_straights, spells
from nathlon.sim.track import load_track

LENGTH_M = 5.0


def trace(lead_m: list[float], at_m: float) -> Trace:
    """Two cars from a place on, the second so far ahead of the first, tick by tick."""
    ticks = len(lead_m)
    cars = np.zeros((ticks, 1, 2), NOTED)
    cars["driving"] = True
    cars["progress"][:, 0, 0] = at_m + np.arange(ticks)
    cars["progress"][:, 0, 1] = cars["progress"][:, 0, 0] + lead_m
    return Trace(np.linspace(SORTED_S, SORTED_S + 0.1 * (ticks - 1), ticks), cars, np.full((1, 2), np.nan))


def test_who_is_beside_the_other_does_not_lead() -> None:
    assert changes(np.array([9.0, 1.0, -4.0, 4.0, 9.0]), LENGTH_M) == 0
    assert changes(np.array([9.0, 1.0, -6.0, 4.0, 9.0]), LENGTH_M) == 2


def test_spells_are_where_a_mask_holds() -> None:
    mask = np.array([True, True, False, True])
    assert spells(mask) == [slice(0, 2), slice(3, 4)]


@pytest.mark.parametrize(
    ("lead_m", "passes", "lost"),
    [([-9.0, 0.0, 9.0, 9.0], 1, 0.0), ([-9.0, 9.0, -9.0, -9.0], 2, 0.5), ([-9.0, -9.0, -2.0, 2.0], 0, None)],
)
def test_a_pass_is_lost_if_the_lead_changes_hands_again(
    lead_m: list[float], passes: int, lost: float | None
) -> None:
    track = load_track("lindenring")
    begin_m, _ = track.stretch("longest straight")
    raced = trace(lead_m, begin_m + 50.0)
    assert passes_on_straights(raced, track, LENGTH_M) == {"passes": passes, "lost": lost}
    raced.cars["penalty_s"] = 1.0
    assert passes_on_straights(raced, track, LENGTH_M)["passes"] == 0


def test_a_pass_in_the_next_lap_is_another_one() -> None:
    track = load_track("lindenring")
    begin_m, end_m = track.stretch("longest straight")
    one, other = trace([-9.0, 9.0], begin_m + 50.0), trace([9.0, -9.0], end_m + 300.0)
    later = trace([9.0, -9.0], track.length + begin_m + 50.0)
    whole = Trace(
        np.concatenate([one.time_s, other.time_s, later.time_s]),
        np.concatenate([one.cars, other.cars, later.cars]),
        one.finish_s,
    )
    assert passes_on_straights(whole, track, LENGTH_M) == {"passes": 2, "lost": 0.0}
