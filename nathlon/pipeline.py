"""The selection from end to end: pareto -> battery -> tournament -> report.

Every stage names its matches, has them run (or finds them in the store), and turns the table of
their results into its answer with a pure function.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import polars as pl

from arena.entrant import Entrant, entrants_table
from arena.match import Match
from arena.pool import match_policies, run_matches
from arena.recorder import record_race
from arena.recording import write_recording
from arena.results import BATTERY, MATCHUPS, RANKING, RESULTS, SKILLS
from arena.store import Store
from nathlon.battery import MEASURES, rank_battery, skills
from nathlon.output import OutputFolder
from nathlon.pareto import pareto
from nathlon.skill import Skill, measure_runs, shipped_skills
from nathlon.stages import filter_matches, skill_matches, tournament_matches
from nathlon.summary import versions
from reports.page import write_page
from reports.replay import write_replay
from reports.selection import Selection
from reports.spreadsheet import write_spreadsheet
from tournament.points import matchups, pair_correlation, rank

STAGES = ("pareto", "battery", "tournament")
CONFIDENCE = 0.95

OnMatch = Callable[[str, int, int], None]
"""Told the stage, matches done and matches in all, whenever a match ends."""


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


@dataclass
class _Run:
    """A selection under way."""

    store: Store
    settings: Settings
    on_match: OnMatch
    keys: list[str] = field(default_factory=list)
    stages: list[dict[str, Any]] = field(default_factory=list)

    def seeds(self, stage: str) -> np.random.SeedSequence:
        """Seeds of a stage's races; no two stages share any, or the winner would be the luckiest."""
        return np.random.SeedSequence([self.settings.seed, STAGES.index(stage)])

    def rng(self, stage: str) -> np.random.Generator:
        """The generator of a stage's bootstrap."""
        return np.random.default_rng([self.settings.seed, len(STAGES), STAGES.index(stage)])

    def results(self, stage: str, matches: Sequence[Match]) -> pl.DataFrame:
        """Results of all matches, running those that the store does not have."""
        missing = [match for match in matches if not self.store.has(match.key)]
        done = len(matches) - len(missing)
        self.on_match(stage, done, len(matches))
        for match, results in run_matches(missing, self.settings.workers):
            self.store.add_match(match.key, stage, match.spec(), results)
            done += 1
            self.on_match(stage, done, len(matches))
        keys = [match.key for match in matches]
        self.keys += keys
        return self.store.results_of(keys) if keys else pl.DataFrame(schema=RESULTS)

    def note(self, stage: str, came: int, left: int, matches: Sequence[Match], began: float) -> None:
        """Keep a stage's counts for the summary."""
        races = sum(len(match.races) for match in matches)
        wall_s = round(time.perf_counter() - began, 2)
        self.stages.append({"name": stage, "in": came, "out": left, "races": races, "wall_s": wall_s})


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
        run = _Run(store, settings, on_match)
        tables: dict[str, pl.DataFrame] = {"entrants": entrants_table(entrants)}
        survivors = _filter(run, entrants, tables)
        shortlist = _test(run, survivors, shipped_skills(), tables)
        matches, results = _race(run, shortlist, tables)
        for name, table in tables.items():
            store.put_table(name, table)

        everything = store.results_of(run.keys)
        files = _record_decider(output, matches, results, tables)
        summary = {
            "stages": run.stages,
            "ranking": _ranking_summary(tables),
            "seed": settings.seed,
            "circuit": entrants[0].circuit,
            "car": entrants[0].car,
            "versions": versions(),
            "pair_correlation": pair_correlation(results),
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


def _filter(run: _Run, entrants: Sequence[Entrant], tables: dict[str, pl.DataFrame]) -> list[Entrant]:
    began = time.perf_counter()
    matches = filter_matches(entrants, run.seeds("pareto"))
    results = run.results("pareto", matches)
    candidates = results.filter(pl.col("entrant").is_in([entrant.id for entrant in entrants]))
    tables["pareto"] = pareto(candidates, run.rng("pareto"))
    kept = set(tables["pareto"].filter("survives")["entrant"])
    survivors = [entrant for entrant in entrants if entrant.id in kept]
    run.note("pareto", len(entrants), len(survivors), matches, began)
    return survivors


def _test(
    run: _Run, entrants: Sequence[Entrant], battery: Sequence[Skill], tables: dict[str, pl.DataFrame]
) -> list[Entrant]:
    began = time.perf_counter()
    planned = skill_matches(entrants, battery, run.seeds("battery"))
    matches = [match for _, _, match in planned]
    results = run.results("battery", matches)
    marks = [
        measure_runs(skill, entrant.id, results.filter(pl.col("match") == match.key))
        for skill, entrant, match in planned
    ]
    measures = pl.concat(marks) if marks else pl.DataFrame(schema=MEASURES)
    if measures.is_empty():
        tables["skills"], tables["battery"] = pl.DataFrame(schema=SKILLS), pl.DataFrame(schema=BATTERY)
    else:
        tables["skills"] = skills(measures, run.rng("battery"))
        tables["battery"] = rank_battery(measures, run.rng("battery"), run.settings.shortlist)
    kept = set(tables["battery"].filter("shortlisted")["entrant"])
    shortlist = [entrant for entrant in entrants if entrant.id in kept]
    run.note("battery", len(entrants), len(shortlist), matches, began)
    return shortlist


def _race(
    run: _Run, entrants: Sequence[Entrant], tables: dict[str, pl.DataFrame]
) -> tuple[list[Match], pl.DataFrame]:
    began = time.perf_counter()
    matches = tournament_matches(entrants, run.settings.pairs, run.seeds("tournament"))
    results = run.results("tournament", matches)
    if matches:
        tables["ranking"] = rank(results, run.rng("tournament"), confidence=CONFIDENCE)
        tables["matchups"] = matchups(results, run.rng("tournament"), confidence=CONFIDENCE)
    else:
        tables["ranking"], tables["matchups"] = pl.DataFrame(schema=RANKING), pl.DataFrame(schema=MATCHUPS)
    first = tables["ranking"].filter(pl.col("rank") == 1).height
    run.note("tournament", len(entrants), first, matches, began)
    return matches, results


def _faults(results: pl.DataFrame) -> int:
    return results.filter(pl.col("ending").is_in(["policy_raised", "illegal_action"])).height


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
