"""The selection from end to end: pareto -> battery -> tournament -> report.

Every stage names its matches, has them run (or finds them in the store), and turns the table of
their results into its answer with a pure function.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl

from arena.entrant import Entrant, entrants_table
from arena.match import Match
from arena.pool import match_policies
from arena.recorder import record_race
from arena.recording import write_recording
from arena.results import POLICY_FAULTS
from arena.store import Store
from nathlon.filter import run_filter
from nathlon.n_athlon import run_battery
from nathlon.output import OutputFolder
from nathlon.race_off import run_round_robin
from nathlon.run import CONFIDENCE, OnMatch, Run
from nathlon.summary import versions
from reports.page import write_page
from reports.replay import write_replay
from reports.selection import Selection
from reports.spreadsheet import write_spreadsheet
from tournament.points import pair_correlation


@dataclass(frozen=True)
class Settings:
    """How much to run.

    Attributes:
        seed: of everything.
        shortlist: entrants that reach the tournament.
        pairs: mirrored pairs a matchup.
        workers: processes.
    """

    seed: int = 1
    shortlist: int = 6
    pairs: int = 12
    workers: int = 1


def select(
    entrants: Sequence[Entrant], output: OutputFolder, settings: Settings, on_match: OnMatch
) -> Selection:
    """Run the whole selection and leave its report.

    A run that was stopped goes on from what its store holds.

    Args:
        entrants: the candidates, all of one circuit and car.
        output: where everything goes.
        settings: how much to run.
        on_match: told about progress.
    """
    with Store(output.store) as store:
        run = Run(store, settings.seed, settings.workers, on_match)
        tables: dict[str, pl.DataFrame] = {"entrants": entrants_table(entrants)}
        filtered = run_filter(run, entrants)
        tested = run_battery(run, filtered.entrants, settings.shortlist)
        raced, matches = run_round_robin(run, tested.entrants, settings.pairs)
        for answer in (filtered, tested, raced):
            tables |= answer.tables
        for name, table in tables.items():
            store.put_table(name, table)

        everything = store.results_of(run.keys)
        files = _record_decider(output, matches, raced.results, tables)
        summary = {
            "stages": run.stages,
            "ranking": _ranking_summary(tables),
            "seed": settings.seed,
            "circuit": entrants[0].circuit,
            "car": entrants[0].car,
            "versions": versions(),
            "pair_correlation": pair_correlation(raced.results),
            "confidence": CONFIDENCE,
            "faults": _faults(everything),
            **files,
        }
        store.put_fact("summary", summary)
    selection = Selection("nathlon: policy selection", tables, everything, summary)
    write_page(selection, output.report)
    write_spreadsheet(selection, output.report / "ranking.xlsx")
    output.write_summary(summary)
    return selection


def _faults(results: pl.DataFrame) -> int:
    return results.filter(pl.col("ending").is_in(POLICY_FAULTS)).height


def _ranking_summary(tables: dict[str, pl.DataFrame]) -> list[dict[str, Any]]:
    names = dict(tables["entrants"].select("entrant", "name").iter_rows())
    return [{"name": names[row["entrant"]], **row} for row in tables["ranking"].iter_rows(named=True)]


def deciding_race(
    matches: Sequence[Match], results: pl.DataFrame, ranking: pl.DataFrame
) -> tuple[Match, int] | None:
    """The closest race that the first of the ranking won against the second; None without one.

    If the first won none, the race that it lost by least.
    """
    if ranking.height < 2:
        return None
    first, second = ranking["entrant"][:2]
    match = next((m for m in matches if set(m.entrants) == {first, second}), None)
    if match is None:
        return None
    points = (
        results.filter(pl.col("match") == match.key).group_by("race", "entrant").agg(pl.col("points").sum())
    )
    margins = (
        points.pivot("entrant", index="race", values="points")
        .with_columns(margin=pl.col(first) - pl.col(second))
        .with_columns(lost=pl.col("margin") <= 0, by=pl.col("margin").abs())
        .sort("lost", "by", "race")
    )
    return match, int(margins["race"][0])


def _record_decider(
    output: OutputFolder, matches: Sequence[Match], results: pl.DataFrame, tables: dict[str, pl.DataFrame]
) -> dict[str, str | None]:
    decider = deciding_race(matches, results, tables["ranking"])
    if decider is None:
        return {"replay": None, "recording": None}
    match, race = decider
    names = dict(tables["entrants"].select("entrant", "name").iter_rows())
    log = record_race(match, match_policies(match), race, [names[entrant] for entrant in match.entrants])
    recording, replay = output.races / "final.mcap", output.replays / "final.rrd"
    write_recording(recording, log)
    write_replay(log, replay)
    return {"replay": f"../replays/{replay.name}", "recording": f"../races/{recording.name}"}
