"""Who runs matches: processes, on this machine or on others, that are given groups of jobs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from itertools import chain
from typing import TypeVar

from nathlon.arena.job import Answer, Job, MatchJob, Wanted
from nathlon.arena.leg import Leg, LegDriven
from nathlon.arena.match import Match
from nathlon.arena.recorder import Recorded
from nathlon.arena.results import VOID_ENDINGS
from nathlon.sim.errors import InputError

JobT = TypeVar("JobT")

Round = list[tuple[Job, Answer]]
"""Jobs that have ended since the last look, with their answers."""
Feed = Callable[[int], list[list[Match]]]
"""Gives so many idle processes groups of matches; none if there is nothing to do now."""


class Executor(ABC):
    """Processes that run matches.

    Attributes:
        workers: how many there are at most.
    """

    workers: int

    @abstractmethod
    def work(self, feed: Callable[[int], Sequence[list[Job]]]) -> Generator[Round, None, None]:
        """Do jobs, asking for more whenever processes have nothing to do; see `race`."""

    def race(self, feed: Feed) -> Generator[list[tuple[Match, Recorded | InputError]], None, None]:
        """Run matches side by side, asking for more whenever processes have nothing to do.

        It ends when all are idle and there is nothing to do now. At every look those matches come that have
        ended since the last one, without logs; instead of one there is an InputError where a policy cannot
        be loaded, or is another one by now.
        """

        def jobs(idle: int) -> list[list[Job]]:
            return [[MatchJob(match) for match in those] for those in feed(idle)]

        with closing(self.work(jobs)) as rounds:
            for ended in rounds:
                yield [(job.match, answer) for job, answer in ended if isinstance(job, MatchJob)]

    def record(self, wanted: Sequence[Wanted]) -> Generator[tuple[Match, Recorded | InputError], None, None]:
        """Run matches again, watched as when they raced, and yield each with what was recorded of it.

        In its place there is an InputError where a policy cannot be loaded or is another one by now,
        where the match came out otherwise, and where a recording cannot be written.
        """
        with closing(self.work(once([[MatchJob(each.match, each)] for each in wanted]))) as rounds:
            for racing, answer in chain.from_iterable(rounds):
                assert isinstance(racing, MatchJob)
                assert racing.wanted is not None, "all are to be recorded"
                if isinstance(answer, Recorded):
                    void = answer.results["ending"].is_in(VOID_ENDINGS).all()
                    yield racing.match, racing.wanted.came_otherwise if void else answer
                else:
                    yield racing.match, answer

    def drive_leg(self, match: Match, leg: Leg) -> LegDriven | InputError:
        """Drive a part of a match, watched as any; an InputError where it cannot go on."""
        with closing(self.work(once([[MatchJob(match, leg=leg)]]))) as rounds:
            [(_, answer)] = chain.from_iterable(rounds)
        if isinstance(answer, LegDriven | InputError):
            return answer
        return InputError(
            f"leg {leg.number + 1} of {match.test}: the simulator failed, expected it to go on; try again"
        )


def once(groups: list[list[JobT]]) -> Callable[[int], list[list[JobT]]]:
    """A feed that gives everything at once."""
    left = [groups]
    return lambda idle: left.pop() if left else []
