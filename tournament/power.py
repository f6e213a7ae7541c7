"""What a tournament can find before it is raced: the least difference that so many units tell apart."""

from __future__ import annotations

from math import sqrt

import numpy as np
import polars as pl
from scipy.special import stdtrit

from nathlon.tournament.event import Event, EventRace
from nathlon.tournament.evidence import MATCHUP, appearances, differences
from nathlon.tournament.stopping import repeated

POWER = 0.8
"""Probability to find a difference of the size that is said to be found."""


def detectable(
    event: Event,
    newcomers: int,
    references: int,
    pairs: int,
    deviation: float,
    confidence: float,
    looks: int,
) -> float:
    """The least true difference of two newcomers, points a race, that an event finds with `POWER`.

    It is found if Student's t of the difference passes the first of Holm's levels for all comparisons, at the
    confidence of repeated looks, as in `nathlon.tournament.points.better`; Cohen, Statistical power analysis
    (1988), chapter 2. One newcomer alone is compared with a reference.

    Args:
        event: what is raced.
        newcomers, references: who races; only a gauntlet tells them apart.
        pairs: units of evidence of every matchup, of races that do not say how many.
        deviation: of a matchup's difference from unit to unit, points a race.
        confidence: of all comparisons together.
        looks: how often it is decided who races on.
    """
    entrants = newcomers + references
    weights = sum(race.weight for race in event.race)
    variance, freedom = 0.0, 0
    for race in event.race:
        units = race.pairs or pairs
        share = race.weight / weights
        variance += share**2 * _spread(race, newcomers, references) * deviation**2 / units
        freedom += meeting_count(race, newcomers, references) * (units - 1)
    level = (1 - repeated(confidence, looks)) / (entrants * (entrants - 1) / 2)
    return float(sqrt(variance) * (stdtrit(freedom, POWER) - stdtrit(freedom, level / 2)))


def meeting_count(race: EventRace, newcomers: int, references: int) -> int:
    """How many meetings so many entrants make in a race of an event."""
    entrants = newcomers + references
    if not race.made.teams:
        return int(entrants > 1)
    return newcomers * references if race.made.gauntlet else entrants * (entrants - 1) // 2


def race_count(event: Event, newcomers: int, references: int, pairs: int) -> int:
    """Races of an event if all units are raced."""
    entrants = newcomers + references
    return sum(
        meeting_count(race, newcomers, references)
        * (race.pairs or pairs)
        * (2 if race.made.teams else max(2, entrants))
        for race in event.race
    )


def unit_deviation(results: pl.DataFrame) -> float | None:
    """How much a matchup's difference varies from unit to unit, points a race, over the matchups of RESULTS.

    None where no matchup has two units.
    """
    met = differences(appearances(results))
    spread = met.group_by("test", *MATCHUP, maintain_order=True).agg(
        variance=pl.col("difference").var(), freedom=pl.len() - 1
    )
    spread = spread.filter(pl.col("freedom") > 0)
    if spread.is_empty():
        return None
    return float(np.sqrt(np.average(spread["variance"].to_numpy(), weights=spread["freedom"].to_numpy())))


def _spread(race: EventRace, newcomers: int, references: int) -> float:
    """Variance of the difference of two fitted scores, in those of a matchup's mean.

    In a round robin every two of K have met and are compared through all others too: 2 / K. In a gauntlet
    only through the R references: 2 / R. In a free-for-all each unit compares all of them: 1.
    """
    if not race.made.teams:
        return 1.0
    if race.made.gauntlet:
        return 2 / references if newcomers > 1 else 1.0
    return 2 / (newcomers + references)
