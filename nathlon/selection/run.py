"""A selection under way: what its stages share to have their matches run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import InitVar, dataclass, field
from functools import partial
from typing import TypeVar

import numpy as np
import polars as pl

from nathlon.arena.engine import MatchEngine
from nathlon.arena.entrance import intact
from nathlon.arena.entrant import Entrant
from nathlon.arena.kernels import compile_kernels
from nathlon.arena.match import Match
from nathlon.arena.pool import Pool
from nathlon.arena.queue_engine import QueueEngine
from nathlon.arena.results import INTERRUPTED, POLICY_FAULTS, RESULTS, VOID_ENDINGS, came_out_alike
from nathlon.arena.store import Store
from nathlon.arena.voids import NotJudged, void_races
from nathlon.arena.world_finding import RACING
from nathlon.results.summary import Stage, Summary
from nathlon.sim.errors import InputError

STAGES = ("pareto", "battery", "tournament")
RECORDINGS = "recordings"
"""What recording every race is called where progress is shown."""
OPENED = "opened"
"""What opening files is called there."""
KERNELS = "kernels"
"""What is compiled before anything races."""
TIMES = "timing"
"""What timing the actions of finalists is called there."""
INCIDENT_RUNS = "incidents"
GATE = "gate"
MATRIX = "matrix"
PLAYED_AGAIN = "played_again"
"""Fact of a run: what came of a match that was played once more."""
PERHAPS_THE_MACHINE = (*VOID_ENDINGS, "timed_out")
"""Endings that a busy machine may bring about."""
CONFIDENCE = 0.95

OTHERWISE = (
    "An episode of scenario {!r} came out otherwise when it was played again with the same seed, so results "
    "hold on average alone, and nobody can repeat them (nathlon world check says what differs)."
)

DONE = "done"
WAITING = "waiting"
"""Status of a run that waits for people to vote."""

AnswerT = TypeVar("AnswerT")
OnMatch = Callable[[str, int, int], None]
"""Told the stage, matches done and matches in all, whenever one ends; of `KERNELS`, how many are compiled."""


@dataclass(frozen=True)
class Answer:
    """What a stage found out.

    Attributes:
        tables: by their names in `nathlon.arena.results.TABLES`.
        entrants: those that go on.
        results: RESULTS of the matches that it had run.
        not_judged: who could not be judged, as most of its runs are void.
    """

    tables: dict[str, pl.DataFrame]
    entrants: list[Entrant]
    results: pl.DataFrame
    not_judged: list[NotJudged]


@dataclass
class Run:
    """A selection under way.

    Attributes:
        store: finished matches, of this run and of others.
        name: of the run in the store.
        seeds_from: what all its randomness comes from.
        pool: where policies are opened and races recorded.
        on_match: told about progress.
        engine: has matches run: by default in the pool, and by whoever works on the same store.
        stages: counts of the stages that have ended.
        gone: entrants whose files went, changed or could not be opened before they were judged, by id.
        status: as what it ends.
    """

    store: Store
    name: str
    seeds_from: tuple[int, ...]
    pool: Pool
    on_match: OnMatch
    stages: list[Stage] = field(default_factory=list)
    gone: dict[str, Entrant] = field(default_factory=dict)
    status: str = DONE
    other_engine: InitVar[MatchEngine | None] = None
    engine: MatchEngine = field(init=False)
    _noted: float = field(default=-math.inf, init=False)
    _ran: int = field(default=0, init=False)
    _run_again: set[str] = field(default_factory=set, init=False)
    _asked: dict[str, Match] = field(default_factory=dict, init=False)

    def __post_init__(self, other_engine: MatchEngine | None) -> None:
        self.engine = other_engine or QueueEngine(self.store, self.pool)
        if interrupted := self.store.interrupted(self.name):
            self.store.forget(interrupted)

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
        """RESULTS of all matches in their order, having those run that the store does not hold.

        What the machine interrupts is run again, once; what it had when the run began, too.
        """
        if not matches:
            return pl.DataFrame(schema=RESULTS)
        wanted = {match.key: match for match in matches}
        self._asked |= wanted
        while True:
            self._have_run(stage, wanted)
            try:
                self.store.use(self.name, wanted)
                results = self.store.results_of(wanted)
            except KeyError:
                # Another process may run again what was interrupted.
                if self.store.stored(wanted) == wanted.keys():
                    raise
                continue
            interrupted = set(results.filter(pl.col("ending") == INTERRUPTED)["match"]) - self._run_again
            if not interrupted:
                self._play_again(matches)
                return results
            self._run_again |= interrupted
            self.store.forget(interrupted)

    def with_those_there(
        self, entrants: Sequence[Entrant], hold: Callable[[list[Entrant]], AnswerT]
    ) -> AnswerT:
        """What a stage comes to with the entrants that can be opened, while it is held.

        Whose file goes, changes or cannot be opened any more is set aside, and the stage is held without it.
        What has run is stored, so that nothing runs twice, and earlier stages stand as they are. The run
        uses no matches of the stage but those of the entrants that are left.

        Args:
            entrants: those that come to the stage.
            hold: holds it with some of them.

        Raises:
            InputError: if nobody is left, or for another reason than a file.
        """
        left = [entrant for entrant in entrants if entrant.id not in self.gone]
        while True:
            self._asked.clear()
            try:
                answer = hold(left)
                if self.gone:
                    self._leave_others()
                return answer
            except InputError:
                there = intact(self.pool, left)
                gone = {each.id: each for each, can in zip(left, there, strict=True) if not can}
                left = [entrant for entrant in left if entrant.id not in gone]
                if not gone or not left:
                    raise
                self.gone |= gone

    def _leave_others(self) -> None:
        """Have the run use no matches of a stage that were planned for those that were set aside."""
        for stage in {match.stage for match in self._asked.values()}:
            used = set(self.store.results_of_run(self.name, stage)["match"])
            self.store.leave(self.name, used - self._asked.keys())

    @property
    def otherwise(self) -> str:
        """That an episode came out otherwise when it was played again, in a sentence; '' where none did."""
        return str(self.store.facts(self.name).get(PLAYED_AGAIN, ""))

    def _play_again(self, matches: Sequence[Match]) -> None:
        """Play the run's first stored match that ended as it should once more, and keep what came otherwise.

        Nathlon's own world repeats to the bit by its tests; of another one nobody knows.
        """
        if matches[0].world == RACING or PLAYED_AGAIN in self.store.facts(self.name):
            return
        ended = next(filter(self._ended_well, matches), None)
        if ended is None:
            return
        try:
            [(match, results)] = self.pool.run([ended])
        except InputError:
            return  # its policies have gone since
        if results["ending"].is_in(PERHAPS_THE_MACHINE).any():
            return  # which says nothing of seeds
        alike = came_out_alike(results, self.store.results_of([match.key]))
        self.store.put_fact(self.name, PLAYED_AGAIN, "" if alike else OTHERWISE.format(match.scenario))

    def _ended_well(self, match: Match) -> bool:
        endings = self.store.results_of([match.key])["ending"]
        return not endings.is_in([*POLICY_FAULTS, *VOID_ENDINGS]).any()

    def _have_run(self, stage: str, wanted: Mapping[str, Match]) -> None:
        """Have those matches run that the store does not hold."""
        stored = self.store.stored(wanted)
        done = len(stored)
        self._say(stage, done, len(wanted))
        missing = [match for key, match in wanted.items() if key not in stored]
        with closing(self.engine.run(missing)) as ended:
            for key, here in ended:
                self._ran += len(wanted[key].races) if here else 0
                done += 1
                self._say(stage, done, len(wanted))

    def _say(self, stage: str, done: int, total: int) -> None:
        """Tell whoever looks on, and note it in the store once a second for those who look from elsewhere."""
        self.on_match(stage, done, total)
        if done == total or time.monotonic() - self._noted > 1.0:
            self.store.put_fact(self.name, "progress", {"stage": stage, "done": done, "total": total})
            self._noted = time.monotonic()

    def keep(self, tables: Mapping[str, pl.DataFrame]) -> None:
        """Keep stage tables, by their names in `nathlon.arena.results.TABLES`."""
        for name, table in tables.items():
            self.store.put_table(self.name, name, table)

    def note(self, stage: str, came: int, left: int, results: pl.DataFrame, began: float) -> None:
        """Keep a stage's counts for the summary; `began` is a reading of `time.perf_counter`, s.

        What it took when the same run came to its end before is counted with it.
        """
        races = results.select(pl.struct("match", "race").n_unique()).item()
        wall_s = round(time.perf_counter() - began, 2)
        before = self._taken_before(stage)
        self.stages.append(
            Stage(
                name=stage,
                entered=came,
                left=left,
                races=races,
                void=void_races(results),
                wall_s=round(wall_s + before.wall_s, 2),
                ran=self._ran + before.ran,
                core_s=round(wall_s * self.engine.workers + before.core_s, 2),
            )
        )
        self._ran = 0

    def _taken_before(self, stage: str) -> Stage:
        """The stage as the run's last summary has it; empty where there is none."""
        said = self.store.facts(self.name).get("summary")
        stages = Summary.model_validate(said).stages if said else ()
        nothing = Stage(name=stage, entered=0, left=0, races=0, wall_s=0.0)
        return next((one for one in stages if one.name == stage), nothing)
