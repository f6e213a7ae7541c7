"""The first stage: thousands of checkpoints race built-in drivers, and tens survive."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
import polars as pl

from arena.entrant import Entrant
from arena.match import Match
from nathlon.pareto import pareto
from nathlon.run import Answer, Run
from nathlon.trials import against, draw_seeds
from sim.scenario import load_scenario

FILTER_SCENARIO = "race"
FILTER_RACES = 4
FILTER_OPPONENTS = ("driver:pace=0.88", "driver:pace=0.93", "driver:pace=0.98")


def run_filter(run: Run, entrants: Sequence[Entrant]) -> Answer:
    """Race all entrants against a common field and keep those that may be on the Pareto front."""
    began = time.perf_counter()
    matches = filter_matches(entrants, run.seeds("pareto"))
    results = run.results("pareto", matches)
    candidates = results.filter(pl.col("entrant").is_in([entrant.id for entrant in entrants]))
    table = pareto(candidates, run.rng("pareto"))
    kept = set(table.filter("survives")["entrant"])
    survivors = [entrant for entrant in entrants if entrant.id in kept]
    run.note("pareto", len(entrants), len(survivors), results, began)
    return Answer({"pareto": table}, survivors, results)


def filter_matches(entrants: Sequence[Entrant], seeds: np.random.SeedSequence) -> list[Match]:
    """A few races from the back of the grid against a common field, the same for every entrant."""
    drawn = draw_seeds(seeds, FILTER_RACES)
    last = load_scenario(FILTER_SCENARIO).cars
    return [
        against("pareto", FILTER_SCENARIO, FILTER_SCENARIO, entrant, FILTER_OPPONENTS, [last], drawn)
        for entrant in entrants
    ]
