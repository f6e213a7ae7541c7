"""What a tournament can find: the error of a difference as the ranking has it, and how often it is found."""

from __future__ import annotations

from math import sqrt

import numpy as np
import polars as pl
import pytest

from nathlon.tournament.event import Event, EventRace
from nathlon.tournament.evidence import Evidence
from nathlon.tournament.formats import FORMATS, FormatName
from nathlon.tournament.points import better
from nathlon.tournament.power import POWER, detectable, race_count, unit_deviation
from tests.support.race_results import tournament

PACE = {"a": 0.5, "b": 0.0, "c": 0.25, "d": 0.25}


def event(format: FormatName) -> Event:
    return Event(race=(EventRace(name="race", circuit="lindenring", car="gt3", format=format),))


@pytest.mark.parametrize("references", ["", "d", "cd"])
def test_the_error_is_that_of_the_fitted_scores(references: str) -> None:
    """Of one comparison without repeated looks the least difference is so many standard errors."""
    results = tournament(PACE, 200, np.random.default_rng(1))
    made = event("4v4")
    if references:
        sides = (pl.col("match").str.slice(at, 1).is_in(list(references)) for at in (0, -1))
        results = results.filter(next(sides) != next(sides))
        made = event("gauntlet")
    deviation = unit_deviation(results)
    assert deviation is not None
    evidence = Evidence(results, {})
    [error], _ = evidence.errors(np.atleast_2d(evidence.solution[0] - evidence.solution[1]))
    new = 4 - len(references)
    found = detectable(made, new, len(references), 200, deviation, 0.95, 1)
    bounds = 2.638 + 0.842  # normal quantiles of 1 - 0.05 / 6 / 2 and of 0.8
    assert found == pytest.approx(bounds * error, rel=0.03)


def test_a_difference_of_that_size_is_found_as_often_as_said() -> None:
    pace = {"a": 0.4, "b": 0.0, "c": 0.2, "d": 0.2}
    many = tournament(pace, 2000, np.random.default_rng(2))
    evidence = Evidence(many, {})
    truth = float((evidence.solution[0] - evidence.solution[1]) @ evidence.means)
    deviation = unit_deviation(many)
    assert deviation is not None
    pairs = next(n for n in range(2, 200) if detectable(event("4v4"), 4, 0, n, deviation, 0.95, 1) <= truth)
    rng = np.random.default_rng(3)
    found = [better(Evidence(tournament(pace, pairs, rng), {}), 0.05)[0, 1] for _ in range(150)]
    assert np.mean(found) == pytest.approx(POWER, abs=0.1)


def test_more_races_find_less_and_more_finalists_need_more_to_be_told_apart() -> None:
    effects = [detectable(event("4v4"), 4, 0, pairs, 3.0, 0.95, 3) for pairs in (4, 16, 64)]
    assert effects == sorted(effects, reverse=True)
    assert effects[1] / effects[2] == pytest.approx(sqrt(4), rel=0.05)
    two, six = (detectable(event("1v1"), n, 0, 12, 3.0, 0.95, 1) * sqrt(n) for n in (2, 6))
    assert six > two, "Holm's correction"
    assert detectable(event("4v4"), 4, 0, 12, 3.0, 0.95, 3) > detectable(event("4v4"), 4, 0, 12, 3.0, 0.95, 1)


@pytest.mark.parametrize("format", FORMATS)
def test_the_races_are_those_of_the_schedule(format: FormatName) -> None:
    from nathlon.tournament.schedule import meetings

    made = FORMATS[format]
    names, references = ["a", "b", "c", "d", "e"], {"d", "e"}
    met = meetings(names, made, 6, np.random.SeedSequence(0), references)
    sides = 2 if made.teams else 5
    races = sum(len(meeting.seeds) * len(made.grids(sides)) for meeting in met)
    assert race_count(event(format), 3, 2, 6) == races


def test_without_two_units_of_a_matchup_nothing_is_known_of_their_spread() -> None:
    assert unit_deviation(tournament({"a": 0.0, "b": 0.0}, 1, np.random.default_rng(0))) is None
