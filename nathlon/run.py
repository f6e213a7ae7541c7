"""A selection under way: what its stages share to have their matches run."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import polars as pl

from arena.entrant import Entrant
from arena.match import Match
from arena.pool import run_matches
from arena.results import RESULTS
from arena.store import Store

STAGES = ("pareto", "battery", "tournament")
CONFIDENCE = 0.95

OnMatch = Callable[[str, int, int], None]
"""Told the stage, matches done and matches in all, whenever a match ends."""


@dataclass
class Run:
    """A selection under way.

    Attributes:
        store: finished matches, of this run and of others.
        seed: of everything.
        workers: processes.
        on_match: told about progress.
        keys: of all matches that the run asked for, in order.
        stages: counts of the stages that have ended.
    """

    store: Store
    seed: int
    workers: int
    on_match: OnMatch
    keys: list[str] = field(default_factory=list)
    stages: list[dict[str, Any]] = field(default_factory=list)

    def seeds(self, stage: str) -> np.random.SeedSequence:
        """Seeds of a stage's races; no two stages share any, or the winner would be the luckiest."""
        return np.random.SeedSequence([self.seed, STAGES.index(stage)])

    def rng(self, stage: str) -> np.random.Generator:
        """The generator of a stage's bootstrap."""
        return np.random.default_rng([self.seed, len(STAGES), STAGES.index(stage)])

    def results(self, stage: str, matches: Sequence[Match]) -> pl.DataFrame:
        """RESULTS of all matches in their order, running those that the store does not have."""
        missing = [match for match in matches if not self.store.has(match.key)]
        done = len(matches) - len(missing)
        self.on_match(stage, done, len(matches))
        for match, results in run_matches(missing, self.workers):
            self.store.add_match(match.key, stage, match.spec(), results)
            done += 1
            self.on_match(stage, done, len(matches))
        keys = [match.key for match in matches]
        self.keys += keys
        return self.store.results_of(keys) if keys else pl.DataFrame(schema=RESULTS)

    def note(self, stage: str, came: int, left: int, results: pl.DataFrame, began: float) -> None:
        """Keep a stage's counts for the summary; `began` is a reading of `time.perf_counter`, s."""
        races = results.select(pl.struct("match", "race").n_unique()).item()
        wall_s = round(time.perf_counter() - began, 2)
        self.stages.append({"name": stage, "in": came, "out": left, "races": races, "wall_s": wall_s})


@dataclass(frozen=True)
class Answer:
    """What a stage found out.

    Attributes:
        tables: by their names in `arena.results.TABLES`.
        entrants: those that go on.
        results: RESULTS of the matches that it had run.
    """

    tables: dict[str, pl.DataFrame]
    entrants: list[Entrant]
    results: pl.DataFrame
