"""Whether a league makes policies clean among their own kind, at no loss of points.

`python -m benchmarks.league LEAGUE --json FILE [--pairs N]` takes the folder that `nathlon league` has left.

- `generations`: its table, a row for each member of each generation;
- `fresh`: the first entrants and the one that the league would go on with meet once more, 4v4, from starts
  that it has never seen: `points_per_race`, `contacts_per_km`, `at_fault_per_km` with 95 % intervals, and
  `penalties` a car and race;
- `duel`: points a race of that one over the champion of the first entrants in these races, with an interval;
- `goals` says which are met: at fault at most 0.02 a kilometre, and no points lost beyond doubt.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import polars as pl

from benchmarks.result import write_result
from nathlon.arena.entrance import enter_all
from nathlon.arena.entrant import Entrant
from nathlon.arena.pool import Pool
from nathlon.lab.league.generation import Generation, Met, members, read_generation
from nathlon.lab.league.league import NAME
from nathlon.lab.league.table import GENERATIONS, table
from nathlon.selection.config import Config
from nathlon.selection.round_robin import TournamentSettings, run_round_robin
from nathlon.selection.single_run import single_run
from nathlon.sim.errors import InputError
from nathlon.terminal.progress import stage_progress

CIRCUIT, CAR = "lindenring", "gt3"
DUEL = ("pairs", "difference", "difference_low", "difference_high")
SEED = 510_051
"""Of the fresh races."""
AT_FAULT = 0.02

Row = dict[str, Any]


def generations_of(folder: Path) -> list[Generation]:
    """The generations of a league.

    Raises:
        InputError: if there is none.
    """
    found: list[Generation] = []
    while (made := read_generation(folder / NAME.format(len(found)))) is not None:
        found.append(made)
    if not found:
        raise InputError(f"{folder}: no generation has met, expected the folder of a league")
    return found


def meet(entrants: Sequence[Entrant], pairs: int, pool: Pool, folder: Path) -> tuple[Met, pl.DataFrame]:
    """What a round robin from fresh starts tells, and its matchups."""
    settings = TournamentSettings(pairs=pairs, sequential=False)
    config = Config(circuit=CIRCUIT, car=CAR, seed=SEED, tournament=settings)
    with (
        stage_progress(True) as on_match,
        single_run("fresh", entrants, config, folder / "store.sqlite", pool, on_match) as run,
    ):
        answer, _ = run_round_robin(run, entrants, settings)
    tables = answer.tables
    return Met(tables["ranking"], tables["ratings"], answer.results), tables["matchups"]


def rounded(row: Row) -> Row:
    """A row with figures as they are told."""
    return {name: round(value, 4) if isinstance(value, float) else value for name, value in row.items()}


def measure(found: Sequence[Generation], pairs: int, workers: int) -> Row:
    """The figures of a league."""
    last = found[-1]
    sources = [member.source for member in found[0].members] + [last.member(last.parent).source]
    with Pool(workers) as pool, tempfile.TemporaryDirectory() as folder:
        entrants = enter_all(pool, sources, CIRCUIT, CAR)
        met, matchups = meet(entrants, pairs, pool, Path(folder))
    fresh = {member.entrant: member for member in members(entrants, met)}
    best, champion = fresh[last.parent], fresh[last.champion]
    told = set(GENERATIONS.names()) - {"generation", "newcomer", "parent", "kept", "weight", "source"}
    duel = matchups.filter(entrant=best.entrant, opponent=champion.entrant).to_dicts()
    not_lost = not duel or duel[0]["difference_high"] >= 0
    return {
        "generations": [rounded(row) for row in table(found).drop("source", "entrant").to_dicts()],
        "fresh": [rounded(member.model_dump(include=told - {"entrant"})) for member in fresh.values()],
        "best": best.name,
        "champion": champion.name,
        "duel": [
            rounded(
                {name: row[name] for name in ("pairs", "difference", "difference_low", "difference_high")}
            )
            for row in duel
        ],
        "goals": {
            "at fault at most 0.02 a kilometre": (best.at_fault_per_km or 0.0) <= AT_FAULT,
            "no points lost beyond doubt": not_lost,
        },
    }


def main() -> None:
    """Measure, and write the JSON."""
    parser = argparse.ArgumentParser(prog="benchmarks.league", description="A league's generations")
    parser.add_argument("league", type=Path, help="folder of a league")
    parser.add_argument("--pairs", type=int, default=24, help="mirrored pairs of every two, fresh")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--json", type=Path, required=True, help="file for the figures")
    chosen = parser.parse_args()
    try:
        figures = measure(generations_of(chosen.league), chosen.pairs, chosen.workers)
    except InputError as error:
        parser.error(str(error))
    write_result(chosen.json, figures)


if __name__ == "__main__":
    main()
