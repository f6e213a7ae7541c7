"""Where matches run: processes on this machine, results whole and in order of completion."""

from __future__ import annotations

import logging
import os
import signal
import threading
import traceback
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import lru_cache
from multiprocessing import connection, parent_process
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import polars as pl

from arena.classification import void
from arena.entrant import enter
from arena.grouping import group
from arena.match import Match
from arena.race_log import RaceLog
from arena.recorder import Recorded, record_races
from arena.recording import recording_name, write_recording
from arena.results import VOID_ENDINGS, came_out_alike
from arena.runner import LineUp, run_together
from arena.team import Absent
from arena.watch import ANSWER_S, FIRST_ANSWER_S, LOOK_S, Asked, Watch
from arena.workers import READY, Worker
from policies.load import DRIVER, load_policy
from policies.policy import Policy
from sim.errors import InputError

log = logging.getLogger(__name__)

OTHERWISE = "it ended otherwise when it was run again, expected the results that are stored"
LOOKS = 5
"""How often a policy is looked at within its time for an answer."""


@lru_cache(maxsize=256)
def _policy(source: str, identity: str, circuit: str, car: str) -> Policy:
    found = enter(source, circuit, car).id
    if found != identity:
        raise InputError(
            f"{source}: has changed since it was entered: its id is {found}, expected {identity}"
        )
    return load_policy(source, circuit, car)


def match_policies(match: Match) -> list[Policy]:
    """The policies of a match, in the order of its entrants.

    Raises:
        InputError: if one cannot be loaded, or is another one by now.
    """
    return [_seat(match, entrant) for entrant in range(len(match.entrants))]


def _seat(match: Match, entrant: int) -> Policy:
    return _policy(match.sources[entrant], match.entrants[entrant], match.circuit, match.car)


class Wanted(NamedTuple):
    """Races of a match that one wants to look at.

    Attributes:
        match: the match.
        races: their indices in it.
        names: of its entrants, as reports show them.
        results: RESULTS that it came to when it was first run.
        folder: where the worker leaves the recordings, instead of sending the logs; None if it sends them.
    """

    match: Match
    races: tuple[int, ...]
    names: tuple[str, ...]
    results: pl.DataFrame
    folder: Path | None = None


@dataclass(frozen=True)
class _Job:
    """A match to run.

    Attributes:
        wanted: what is to be recorded of it; None if nothing is.
        absent: endings of the entrants that are not asked, having stopped a worker before.
        alone: whether it runs by itself in a fresh worker, having lost one for an unknown reason.
    """

    match: Match
    wanted: Wanted | None = None
    absent: Mapping[int, str] = field(default_factory=dict)
    alone: bool = False


class Pool:
    """Processes that run matches; they start when they are needed and stay until the pool is closed.

    To be used in a `with` statement. Results do not depend on the number of processes, nor on which
    matches share one.

    Attributes:
        workers: how many processes there are at most.
    """

    def __init__(
        self, workers: int, answer_s: float = ANSWER_S, first_answer_s: float = FIRST_ANSWER_S
    ) -> None:
        """A pool without processes yet; see `Watch` for the times."""
        self.workers = workers
        self._answer_s, self._first_answer_s = answer_s, first_answer_s
        self._processes: dict[Worker, dict[int, _Job]] = {}

    def __enter__(self) -> Pool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End all processes at once."""
        for worker in self._processes:
            worker.kill()
        self._processes.clear()

    def run(self, matches: Sequence[Match]) -> Generator[tuple[Match, pl.DataFrame], None, None]:
        """Run matches side by side and yield each with its results as it ends.

        A policy that does not answer in time is out of its match as `timed_out`, and one that ends the
        process as `policy_raised`; a match in which the simulator does so twice is void.

        Raises:
            InputError: when all others have run, if a policy cannot be loaded or is another one by now.
        """
        refused: list[InputError] = []
        groups = [[_Job(match) for match in those] for those in group(matches, self.workers)]
        with closing(self._work(groups)) as ended:
            for match, answer in ended:
                if isinstance(answer, InputError):
                    refused.append(answer)
                else:
                    yield match, answer.results
        if refused:
            raise refused[0]

    def record(
        self, wanted: Sequence[Wanted]
    ) -> Generator[tuple[Match, list[RaceLog] | InputError], None, None]:
        """Run matches again, watched as in `run`, and yield each with the logs of its wanted races.

        In place of the logs there is an InputError where a policy cannot be loaded or is another one by now,
        where the match came out otherwise, and where a recording cannot be written.
        """
        with closing(self._work([[_Job(each.match, each)] for each in wanted])) as ended:
            for match, answer in ended:
                if isinstance(answer, Recorded):
                    void = answer.results["ending"].is_in(VOID_ENDINGS).all()
                    yield match, _otherwise(match) if void else answer.logs
                else:
                    yield match, answer

    def _work(
        self, groups: Iterable[list[_Job]]
    ) -> Generator[tuple[Match, Recorded | InputError], None, None]:
        queue = deque(groups)
        try:
            while queue or any(self._processes.values()):
                self._hand_out(queue)
                # A worker that ends its matches is given others before these results are dealt with.
                ended = list(self._collect(queue))
                self._hand_out(queue)
                yield from ended
        finally:
            # Only those that are at work when the run is given up.
            for worker in [worker for worker, jobs in self._processes.items() if jobs]:
                worker.kill()
                del self._processes[worker]

    def _hand_out(self, queue: deque[list[_Job]]) -> None:
        """Give the first in the queue to workers that are idle, and start those that are missing."""
        busy = sum(map(bool, self._processes.values()))
        for _ in range(min(self.workers, busy + len(queue)) - len(self._processes)):
            self._start()
        for worker in [worker for worker in self._processes if worker.idle]:
            if queue and queue[0][0].alone and not worker.fresh:
                worker.kill()
                del self._processes[worker]
                self._start()
            elif queue:
                jobs = queue.popleft()
                self._processes[worker] = dict(enumerate(jobs))
                worker.give(jobs)

    def _start(self) -> None:
        self._processes[Worker(_serve, self._answer_s, self._first_answer_s)] = {}

    def _collect(self, queue: deque[list[_Job]]) -> Iterator[tuple[Match, Recorded | InputError]]:
        """Wait for news; results as they come, and into the queue what a lost worker leaves."""
        connection.wait(
            [sign for worker in self._processes for sign in worker.signs],
            min(LOOK_S, self._answer_s / LOOKS, self._first_answer_s / LOOKS),
        )
        for worker, jobs in list(self._processes.items()):
            killed = not worker.dead and worker.patience.over
            if killed:
                worker.kill()
            lost = worker.dead
            for message in worker.news():
                if isinstance(message, RuntimeError):
                    raise message
                number, answer = message
                yield jobs.pop(number).match, answer
            if lost:
                del self._processes[worker]
                if not worker.began:
                    raise RuntimeError("a worker process ended before it could begin")
                if jobs:
                    # It may have gone on in its last moment.
                    late = killed and worker.patience.over
                    groups, given_up = _again(jobs, worker.watch.asked, late)
                    queue.extend(groups)
                    yield from ((match, Recorded(void(match), [])) for match in given_up)


def _again(jobs: Mapping[int, _Job], asked: Asked, late: bool) -> tuple[list[list[_Job]], list[Match]]:
    """What to do about the matches that a lost worker has not finished.

    Args:
        jobs: these matches.
        asked: what the worker was at.
        late: whether it was ended for not getting on with it.

    Returns:
        groups to run, and matches that the simulator cannot run.
    """
    if asked.match not in jobs:
        given_up = [job.match for job in jobs.values() if job.alone]
        return [[replace(job, alone=True)] for job in jobs.values() if not job.alone], given_up
    job = jobs[asked.match]
    others = [job for number, job in jobs.items() if number != asked.match]
    if late or job.alone:
        ending = "timed_out" if late else "policy_raised"
        log.warning("%s: %s: its cars are out", job.match.sources[asked.entrant], ending)
        job = replace(job, absent={**job.absent, asked.entrant: ending}, alone=False)
    else:
        job = replace(job, alone=True)
    return [jobs_ for jobs_ in (others, [job]) if jobs_], []


def run_matches(matches: Sequence[Match], workers: int) -> Iterator[tuple[Match, pl.DataFrame]]:
    """Run matches in a pool of their own; see `Pool.run`."""
    with Pool(workers) as pool, closing(pool.run(matches)) as results:
        yield from results


def _serve(pipe: connection.Connection, watch: Watch) -> None:
    """Run what comes through the pipe, and send (number, Recorded or InputError) of each match."""
    # Ctrl-C is for the parent to handle; it then ends its workers at once, for a match that is not
    # finished is not stored.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        pipe.send(READY)
        try:
            jobs: list[_Job] = pipe.recv()
        except EOFError:
            return
        try:
            for message in _run(jobs, watch):
                watch.rest()
                pipe.send(message)
        except MemoryError:
            raise
        except Exception:
            # Of ours, not of a policy: it is for the user to see.
            pipe.send(RuntimeError(traceback.format_exc()))
        watch.rest()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _run(jobs: Iterable[_Job], watch: Watch) -> Iterator[tuple[int, Recorded | InputError]]:
    line_ups: dict[int, LineUp] = {}
    for number, job in enumerate(jobs):
        try:
            policies = [_present(job, number, entrant, watch) for entrant in range(len(job.match.entrants))]
        except InputError as error:
            yield number, error
            continue
        if job.wanted:
            yield number, _record(job.wanted, policies, watch)
        else:
            line_ups[number] = job.match, policies
    if line_ups:
        for number, results in run_together(line_ups, watch):
            yield number, Recorded(results, [])


def _record(wanted: Wanted, policies: Sequence[Policy | Absent], watch: Watch) -> Recorded | InputError:
    recorded = record_races(wanted.match, policies, wanted.races, wanted.names, watch)
    if not came_out_alike(recorded.results, wanted.results):
        return _otherwise(wanted.match)
    if wanted.folder is None:
        return recorded
    watch.rest()
    try:
        for race_log in recorded.logs:
            write_recording(wanted.folder / recording_name(wanted.match.key, race_log.race), race_log)
    except OSError as error:
        return InputError(f"{wanted.folder}: the recording cannot be written: {error.strerror}")
    return recorded._replace(logs=[])


def _otherwise(match: Match) -> InputError:
    """Its policies or this machine do not compute the same as then, so that it is not what was seen then."""
    return InputError(f"match {match.key[:10]}: {OTHERWISE}")


def _present(job: _Job, number: int, entrant: int, watch: Watch) -> Policy | Absent:
    """A policy of a match, watched while it is loaded."""
    if entrant in job.absent:
        return Absent(job.absent[entrant])
    if job.match.sources[entrant].partition(":")[0] == DRIVER:
        watch.work()
    else:
        watch.ask(number, entrant, first=True)
    return _seat(job.match, entrant)
