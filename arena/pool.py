"""Where policies run: processes on this machine, results whole and in order of completion."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import chain
from multiprocessing import connection
from types import TracebackType
from typing import Any

import polars as pl

from nathlon.arena.executor import Executor, Round, once
from nathlon.arena.grouping import group
from nathlon.arena.job import Answer, Job, Loss, Opening, again
from nathlon.arena.match import Match
from nathlon.arena.serving import do, serve
from nathlon.arena.watch import MATCH_S, Watch
from nathlon.arena.workers import Worker, new_output_log
from nathlon.policies.patience import ANSWER_S, FIRST_ANSWER_S, LOOK_S
from nathlon.policies.sources import OBJECT
from nathlon.sim.errors import InputError

LOOKS = 5
"""How often a policy is looked at within its time for an answer."""
MOST_OPENINGS = 16
"""Of those that a worker is given at once."""


def quietly(_done: int, _total: int) -> None:
    """Nobody wants to be told how far it is."""


class Pool(Executor):
    """Processes of this machine that open policies and run matches.

    To be used in a `with` statement: they start when needed and stay until it is closed. Results do not
    depend on the number of processes, nor on which matches share one. Matches with a policy that was handed
    over as an object run in this process.

    Attributes:
        workers: how many processes there are at most.
        log: what policies have printed in them.
        here: whether everything runs in this process; see `nathlon.arena.workers.need_worker`.
    """

    def __init__(
        self,
        workers: int,
        answer_s: float = ANSWER_S,
        first_answer_s: float = FIRST_ANSWER_S,
        match_s: float = MATCH_S,
    ) -> None:
        """A pool without processes yet; see `Watch` for the times."""
        self.workers, self.here = workers, False
        self.log = new_output_log()
        self._times = answer_s, first_answer_s, match_s
        self._look_s = min(LOOK_S, answer_s / LOOKS, first_answer_s / LOOKS)
        self._processes: dict[Worker, dict[int, Job]] = {}

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
        self.log.close()

    def open(self, openings: Sequence[Opening], on_opened: Callable[[int, int], None] = quietly) -> list[Any]:
        """Open policies, watched as those that race, in processes that files cannot harm.

        Args:
            openings: what to call.
            on_opened: told how many have come to an end, of how many.

        Returns:
            for each what its function returned, or an InputError: because it raised one, did not come to an
            end in time, or ended its process.
        """
        size = max(1, min(MOST_OPENINGS, math.ceil(len(openings) / (2 * self.workers))))
        groups: list[list[Job]] = [
            list(openings[begin : begin + size]) for begin in range(0, len(openings), size)
        ]
        answers: dict[Opening, Any] = {}
        with closing(self.work(once(groups))) as rounds:
            for opening, answer in chain.from_iterable(rounds):
                assert isinstance(opening, Opening)
                answers[replace(opening, alone=False)] = answer
                on_opened(len(answers), len(openings))
        return [answers[opening] for opening in openings]

    def run(self, matches: Sequence[Match]) -> Generator[tuple[Match, pl.DataFrame], None, None]:
        """Run matches side by side and yield each with its results as it ends.

        A policy that does not answer in time is out of its match as `timed_out`, and one that ends the
        process as `policy_raised`; a match in which the simulator does so twice is void.

        Raises:
            InputError: when all others have run, if a policy cannot be loaded or is another one by now.
        """
        refused: list[InputError] = []
        with closing(self.race(once(group(matches, self.workers)))) as rounds:
            for match, answer in chain.from_iterable(rounds):
                if isinstance(answer, InputError):
                    refused.append(answer)
                else:
                    yield match, answer.results
        if refused:
            raise refused[0]

    def work(self, feed: Callable[[int], Sequence[list[Job]]]) -> Generator[Round, None, None]:
        """As of `Executor`."""
        queue: deque[list[Job]] = deque()
        ended: Round = []
        try:
            while True:
                idle = self.workers - self._busy
                for jobs in feed(idle) if idle and not queue else ():
                    here = [job for job in jobs if self._runs_here(job)]
                    for number, answer in do(here, Watch()):
                        yield [(here[number], answer)]
                    if elsewhere := [job for job in jobs if not self._runs_here(job)]:
                        queue.append(elsewhere)
                # A worker that ends its matches is given others before these results are dealt with.
                self._hand_out(queue)
                yield ended
                if not queue and not self._busy:
                    break
                ended = list(self._collect(queue))
        finally:
            # Only those that are at work when the run is given up.
            for worker in [worker for worker, jobs in self._processes.items() if jobs]:
                worker.kill()
                del self._processes[worker]

    def _runs_here(self, job: Job) -> bool:
        """In this process; also where a policy takes part that no other has."""
        return self.here or any(source.partition(":")[0] == OBJECT for source in job.sources)

    @property
    def _busy(self) -> int:
        return sum(map(bool, self._processes.values()))

    def _hand_out(self, queue: deque[list[Job]]) -> None:
        """Give the first in the queue to workers that are idle, and start those that are missing."""
        for _ in range(min(self.workers, self._busy + len(queue)) - len(self._processes)):
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
        self._processes[Worker(serve, self.log.sink, *self._times)] = {}

    def _collect(self, queue: deque[list[Job]]) -> Iterator[tuple[Job, Answer]]:
        """Wait for news; results as they come, and into the queue what a lost worker leaves."""
        connection.wait([sign for worker in self._processes for sign in worker.signs], self._look_s)
        for worker, jobs in list(self._processes.items()):
            killed = not worker.dead and worker.patience.over
            hung = killed and worker.patience.asleep
            if killed:
                worker.kill()
            lost = worker.dead
            for message in worker.news():
                if isinstance(message, RuntimeError):
                    raise message
                number, answer = message
                yield jobs.pop(number), answer
            if lost:
                worker.kill()
                del self._processes[worker]
                if not worker.began:
                    raise RuntimeError("a worker process ended before it could begin")
                if jobs:
                    # It may have gone on in its last moment.
                    late = killed and worker.patience.over
                    memory = not killed and not worker.unreadable and worker.out_of_memory
                    asked, taken = worker.watch.asked, worker.watch.taken
                    loss = Loss(asked, late, memory, taken, hung, worker.unreadable, worker.closed)
                    groups, given_up = again(jobs, loss)
                    queue.extend(groups)
                    yield from given_up


def run_matches(matches: Sequence[Match], workers: int) -> Iterator[tuple[Match, pl.DataFrame]]:
    """Run matches in a pool of their own; see `Pool.run`."""
    with Pool(workers) as pool, closing(pool.run(matches)) as results:
        yield from results
