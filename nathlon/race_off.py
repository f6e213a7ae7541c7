"""The third stage: every two of the shortlist meet in mirrored 4v4 races."""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import groupby

import numpy as np
import polars as pl

from arena.entrant import Entrant
from arena.match import Match, Race, Seat
from arena.results import MATCHUPS, RANKING
from nathlon.run import CONFIDENCE, Answer, Run
from tournament.points import matchups, rank
from tournament.schedule import MIRRORED_GRIDS, round_robin

TOURNAMENT_SCENARIO = "race"


def run_round_robin(run: Run, entrants: Sequence[Entrant], pairs: int) -> tuple[Answer, list[Match]]:
    """Race all entrants against each other; those that share the first rank go on."""
    began = time.perf_counter()
    matches = tournament_matches(entrants, pairs, run.seeds("tournament"))
    results = run.results("tournament", matches)
    if matches:
        tables = {
            "ranking": rank(results, run.rng("tournament"), confidence=CONFIDENCE),
            "matchups": matchups(results, run.rng("tournament"), confidence=CONFIDENCE),
        }
    else:
        tables = {"ranking": pl.DataFrame(schema=RANKING), "matchups": pl.DataFrame(schema=MATCHUPS)}
    first = set(tables["ranking"].filter(pl.col("rank") == 1)["entrant"])
    leaders = [entrant for entrant in entrants if entrant.id in first]
    run.note("tournament", len(entrants), len(leaders), results, began)
    return Answer(tables, leaders, results), matches


def tournament_matches(entrants: Sequence[Entrant], pairs: int, seeds: np.random.SeedSequence) -> list[Match]:
    """A 4v4 round robin of mirrored pairs, one match a matchup."""
    by_id = {entrant.id: entrant for entrant in entrants}
    matches = []
    schedule = round_robin([entrant.id for entrant in entrants], pairs, seeds)
    for (first, second), meetings in groupby(schedule, lambda pairing: (pairing.entrant, pairing.opponent)):
        races = []
        for meeting in meetings:
            for grid in MIRRORED_GRIDS:
                seats = [Seat(int(slot in grid.slots[1]), int(slot in grid.slots[1])) for slot in range(1, 9)]
                races.append(Race(meeting.seed, tuple(seats), grid.mirrored))
        a, b = by_id[first], by_id[second]
        matches.append(
            Match(
                "tournament",
                TOURNAMENT_SCENARIO,
                TOURNAMENT_SCENARIO,
                a.circuit,
                a.car,
                (a.id, b.id),
                (a.source, b.source),
                tuple(races),
            )
        )
    return matches
