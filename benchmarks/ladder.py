"""A bundled ladder: the selection among its checkpoints, and fresh races of them, kept in a folder.

Seeds of fresh races are none that a selection has. Every two entrants have seeds of their own, whoever else
races, and fewer pairs are the first of more: benchmarks with the same folder share them.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
import polars as pl

from benchmarks.ladders import folders, ladder
from nathlon.arena.entrance import enter_all, trained_on
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match
from nathlon.arena.pool import Pool
from nathlon.arena.world_registry import home
from nathlon.policies.load import load_file
from nathlon.selection.battery import marked, marking_matches, skill_matches
from nathlon.selection.battery.measures import measured
from nathlon.selection.battery.skill import load_skills
from nathlon.selection.config import Config
from nathlon.selection.field import EntryList
from nathlon.selection.pareto.filter import FilterPlan
from nathlon.selection.pipeline import run_pipeline
from nathlon.selection.round_robin import plan
from nathlon.selection.run import Run
from nathlon.selection.single_run import single_run
from nathlon.sim.data_file import DATA
from nathlon.terminal.progress import stage_progress

FRESH = 20_261_125
"""Seed of the fresh races."""
BLOCK = 20
"""Mirrored pairs of a match: what is lost at most when racing is stopped."""


@dataclass(frozen=True)
class Ladder:
    """The checkpoints of a circuit and who was selected of them.

    Attributes:
        run: has matches run, or finds them in the folder's store.
        config: of the selection.
        entrants: all checkpoints.
        sent: whom the selection sends.
    """

    run: Run
    config: Config
    entrants: tuple[Entrant, ...]
    sent: Entrant

    @property
    def survivors(self) -> list[Entrant]:
        """Those that the filter kept."""
        return self._among(self.run.store.table(self.run.name, "battery"))

    @property
    def finalists(self) -> list[Entrant]:
        """Those that raced the round robin, best first."""
        return self._among(self.run.store.table(self.run.name, "ranking"))

    @property
    def fastest(self) -> Entrant:
        """The one with the best mean lap of the filter's time trials."""
        laps = self.run.store.table(self.run.name, "pareto").drop_nulls("lap_s")
        return self._among(laps.sort("lap_s"))[0]

    @property
    def last(self) -> Entrant:
        """The one with the most transitions."""
        return max(self.entrants, key=lambda one: load_file(Path(one.source)).card.transitions or 0)

    @property
    def tournament_races(self) -> int:
        """Races of the selection's round robin, each of two entrants."""
        return int(self.run.store.table(self.run.name, "ranking")["races"].sum()) // 2

    def _among(self, table: pl.DataFrame) -> list[Entrant]:
        by_id = {entrant.id: entrant for entrant in self.entrants}
        return [by_id[entrant] for entrant in table["entrant"]]

    def race(self, entrants: Sequence[Entrant], pairs: int) -> pl.DataFrame:
        """RESULTS of so many fresh mirrored pairs of every two, 4v4."""
        matches = [match for two in combinations(entrants, 2) for match in self._meeting(two, pairs)]
        return self.run.results("tournament", matches)

    def filter_runs(self, runs: int) -> pl.DataFrame:
        """RESULTS of so many fresh time trials and races of every checkpoint, as the filter has them."""
        settings = self.config.pareto.model_copy(update={"races": runs, "most_races": runs})
        plan = FilterPlan(settings, home(self.sent), np.random.SeedSequence([FRESH, 1]))
        matches = [*plan.time_trials(self.entrants, 0), *plan.races(self.entrants, 0)]
        return self.run.results("pareto", matches)

    def marks(self, runs: int) -> pl.DataFrame:
        """MARKS of so many fresh runs of every survivor in every test."""
        settings = self.config.battery
        tests = load_skills(settings.tests)
        own = marking_matches(tests, self.sent)
        planned = skill_matches(self.survivors, tests, np.random.SeedSequence([FRESH, 2]), runs)
        results = self.run.results("battery", [*own.values(), *planned.values()])
        frames = {str(key): frame for (key,), frame in results.partition_by("match", as_dict=True).items()}
        tables = []
        for skill in tests:
            how = measured(skill.measure, home(self.sent))
            marks = skill.marks(skill.runs_of(frames[own[skill.name].key], how), how)
            if marks is not None:
                theirs = {one.id: frames[planned[skill.name, one.id].key] for one in self.survivors}
                tables.append(marked(skill, theirs, marks, how))
        return pl.concat(tables)

    def _meeting(self, two: Sequence[Entrant], pairs: int) -> list[Match]:
        ordered = sorted(two, key=lambda entrant: entrant.id)
        own = zlib.crc32("\n".join(entrant.id for entrant in ordered).encode())
        event = self.config.tournament.held(self.config.circuit, self.config.car)
        [fixture] = plan(event, [ordered], pairs, np.random.SeedSequence([FRESH, own]))
        return [fixture.match(slice(begin, begin + BLOCK)) for begin in range(0, pairs, BLOCK)]


def circuits() -> list[str]:
    """Those with bundled checkpoints of their own."""
    known = (folder.name for folder in (DATA / "circuits").iterdir())
    return sorted(name for name in known if folders(name))


@contextmanager
def selected(circuit: str, folder: Path, workers: int) -> Iterator[Ladder]:
    """Select among the bundled checkpoints of a circuit as `nathlon evaluate` does, or go on with it.

    Args:
        circuit: name of a bundled folder.
        folder: of the store.
        workers: processes.

    Raises:
        InputError: if the store cannot be used.
    """
    with Pool(workers) as pool, stage_progress(True) as on_match:
        sources = list(map(str, ladder(circuit)))
        circuit, car = trained_on(pool, sources)
        config = Config(circuit=circuit, car=car)
        entrants = enter_all(pool, sources, circuit, car)
        folder.mkdir(parents=True, exist_ok=True)
        with single_run("selection", entrants, config, folder / "store.sqlite", pool, on_match) as run:
            summary = run_pipeline(run, EntryList(tuple(entrants)), config)
            assert summary is not None, "the standard committee does not wait for people"
            sent = summary.sent[0].entrant
            yield Ladder(run, config, tuple(entrants), next(e for e in entrants if e.id == sent))
