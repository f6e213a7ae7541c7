"""A selection under way: what its stages share to have their matches run."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import polars as pl

from nathlon.arena.entrant import Entrant
from nathlon.arena.kernels import compile_kernels
from nathlon.arena.match import Match
from nathlon.arena.pool import Pool
from nathlon.arena.results import RESULTS
from nathlon.arena.store import Store
from nathlon.reports.summary import Stage
from nathlon.sim.process import HOST, has_ended

STAGES = ("pareto", "battery", "tournament")
RECORDINGS = "recordings"
"""What recording every race is called where progress is shown."""
KERNELS = "kernels"
"""What is compiled before anything races."""
INCIDENT_RUNS = "incidents"
GATE = "gate"
MATRIX = "matrix"
CONFIDENCE = 0.95

DONE = "done"
WAITING = "waiting"
"""Status of a run that waits for people to vote."""

CLAIM_S = 600.0
"""For which a process has a match to itself; it renews its claims well before."""
POLL_S = 0.5
"""Between two looks at matches that another process runs."""
CLAIM_SHARE = 2
"""A process claims half of what is left at once, so that others on the same store find work too."""
CLAIM_LEAST = 16
"""Matches for each worker, if there are as many: together they cost much less than apart."""

OnMatch = Callable[[str, int, int], None]
"""Told the stage, matches done and matches in all, whenever one ends; of `KERNELS`, how many are compiled."""


@dataclass(frozen=True)
class Answer:
    """What a stage found out.

    Attributes:
        tables: by their names in `nathlon.arena.results.TABLES`.
        entrants: those that go on.
        results: RESULTS of the matches that it had run.
    """

    tables: dict[str, pl.DataFrame]
    entrants: list[Entrant]
    results: pl.DataFrame


@dataclass
class Run:
    """A selection under way.

    Attributes:
        store: finished matches, of this run and of others.
        name: of the run in the store.
        seeds_from: what all its randomness comes from.
        pool: where matches run.
        on_match: told about progress.
        stages: counts of the stages that have ended.
        status: as what it ends.
    """

    store: Store
    name: str
    seeds_from: tuple[int, ...]
    pool: Pool
    on_match: OnMatch
    stages: list[Stage] = field(default_factory=list)
    status: str = DONE
    _noted: float = field(default=-math.inf, init=False)
    _ran: int = field(default=0, init=False)

    def seeds(self, stage: str) -> np.random.SeedSequence:
        """Seeds of a stage's races; no two stages share any, or the winner would be the luckiest."""
        return np.random.SeedSequence([*self.seeds_from, STAGES.index(stage)])

    def rng(self, stage: str) -> np.random.Generator:
        """The generator of a stage's bootstrap."""
        return np.random.default_rng([*self.seeds_from, len(STAGES), STAGES.index(stage)])

    def compile(self, world: str, circuit: str, car: str) -> None:
        """Have what races need compiled; see `nathlon.arena.kernels.compile_kernels`."""
        compile_kernels(self.pool, world, circuit, car, partial(self.on_match, KERNELS))

    def results(self, stage: str, matches: Sequence[Match]) -> pl.DataFrame:
        """RESULTS of all matches in their order, running those that the store does not have.

        What another process on the same store is running is waited for.
        """
        if not matches:
            return pl.DataFrame(schema=RESULTS)
        wanted = {match.key: match for match in matches}
        owner = f"{HOST}/{os.getpid()}"
        try:
            while missing := self._missing(stage, wanted):
                for dead in filter(_is_gone, self.store.owners()):
                    self.store.release(dead)
                share = max(math.ceil(len(missing) / CLAIM_SHARE), CLAIM_LEAST * self.pool.workers)
                claimed = self.store.claim(missing[:share], owner, CLAIM_S)
                if claimed:
                    done = len(wanted) - len(missing)
                    self._run(stage, [wanted[key] for key in claimed], owner, done, len(wanted))
                else:
                    time.sleep(POLL_S)
        finally:
            self.store.release(owner)
        self.store.use(self.name, wanted)
        return self.store.results_of(wanted)

    def _say(self, stage: str, done: int, total: int) -> None:
        """Tell whoever looks on, and note it in the store once a second for those who look from elsewhere."""
        self.on_match(stage, done, total)
        if done == total or time.monotonic() - self._noted > 1.0:
            self.store.put_fact(self.name, "progress", {"stage": stage, "done": done, "total": total})
            self._noted = time.monotonic()

    def _missing(self, stage: str, wanted: dict[str, Match]) -> list[str]:
        stored = self.store.stored(wanted)
        self._say(stage, len(stored), len(wanted))
        return [key for key in wanted if key not in stored]

    def _run(self, stage: str, matches: Sequence[Match], owner: str, done: int, total: int) -> None:
        """Run matches that are claimed, and store each as it ends."""
        left = {match.key: match for match in matches}
        renewed = time.monotonic()
        with closing(self.pool.run(matches)) as finished:
            for match, results in finished:
                self.store.add_match(match.key, stage, match.spec(), results)
                del left[match.key]
                self._ran += len(match.races)
                if time.monotonic() - renewed > CLAIM_S / 4:
                    self.store.claim(list(left), owner, CLAIM_S)
                    renewed = time.monotonic()
                done += 1
                self._say(stage, done, total)

    def keep(self, tables: Mapping[str, pl.DataFrame]) -> None:
        """Keep stage tables, by their names in `nathlon.arena.results.TABLES`."""
        for name, table in tables.items():
            self.store.put_table(self.name, name, table)

    def note(self, stage: str, came: int, left: int, results: pl.DataFrame, began: float) -> None:
        """Keep a stage's counts for the summary; `began` is a reading of `time.perf_counter`, s."""
        races = results.select(pl.struct("match", "race").n_unique()).item()
        wall_s = round(time.perf_counter() - began, 2)
        core_s = round(wall_s * self.pool.workers, 2)
        self.stages.append(
            Stage(
                name=stage,
                entered=came,
                left=left,
                races=races,
                wall_s=wall_s,
                ran=self._ran,
                core_s=core_s,
            )
        )
        self._ran = 0


def _is_gone(owner: str) -> bool:
    """Whether the owner of some claims was a process on this machine that has ended."""
    host, _, process = owner.rpartition("/")
    return host == HOST and has_ended(int(process))
