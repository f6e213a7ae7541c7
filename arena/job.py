"""What a worker is given to do, and what is to be done about it when the worker is lost."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl

from nathlon.arena.classification import void
from nathlon.arena.leg import Leg
from nathlon.arena.match import Match
from nathlon.arena.processor import processor
from nathlon.arena.recorder import Recorded
from nathlon.arena.results import INTERRUPTED
from nathlon.arena.watch import NOBODY, Asked, Taken
from nathlon.sim.errors import InputError

log = logging.getLogger(__name__)

HOG_BYTES = 256 << 20
"""Who has taken less memory than this is not blamed for there being none."""

CHANNELS = "what its process answers or prints through"
OTHERWISE = "it ended otherwise when it was run again, expected the results that are stored"


class Wanted(NamedTuple):
    """Races of a match that one wants to look at.

    Attributes:
        match: the match.
        races: their indices in it.
        names: of its entrants, as reports show them.
        results: RESULTS that it came to when it was first run; None if it was not.
        folder: where the worker leaves the recordings, instead of sending the logs; None if it sends them.
        seen_by: a car of the first of these races; what its drivers see is sent as well.
        processor: kind of processor that ran it first, if that is known.
    """

    match: Match
    races: tuple[int, ...]
    names: tuple[str, ...]
    results: pl.DataFrame | None
    folder: Path | None = None
    seen_by: int | None = None
    processor: str | None = None

    @property
    def came_otherwise(self) -> InputError:
        """That policies or this machine compute otherwise than then, so that it is not what was seen."""
        here, then = processor(), self.processor
        why = "" if then in (None, here) else f" (they are of a processor {then}, and this one is {here})"
        return InputError(f"match {self.match.key[:10]}: {OTHERWISE}{why}")


@dataclass(frozen=True)
class MatchJob:
    """A match to run.

    Attributes:
        wanted: what is to be recorded of it; None if nothing is.
        leg: which part of it is to be driven; None for all of it.
        absent: endings of the entrants that are not asked, having stopped a worker before.
        alone: whether it runs by itself in a fresh worker, having lost one for an unknown reason.
    """

    match: Match
    wanted: Wanted | None = None
    leg: Leg | None = None
    absent: Mapping[int, str] = field(default_factory=dict)
    alone: bool = False

    @property
    def sources(self) -> tuple[str, ...]:
        """Of the policies that it asks."""
        return self.match.sources


@dataclass(frozen=True)
class Opening:
    """A function to call that opens somebody's policy.

    Attributes:
        source: of the policy, for the error.
        function: a module's own, called with `arguments`; what it returns can be pickled.
        alone: as for `MatchJob`.
        expected: what it opens, for the error.
    """

    source: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    alone: bool = False
    expected: str = "a policy"

    @property
    def sources(self) -> tuple[str, ...]:
        """Of the policy that it opens."""
        return (self.source,)


Job = MatchJob | Opening
Answer = Any
"""`Recorded`, `LegDriven` or what the function of an `Opening` returns; an InputError where it fails."""


class Loss(NamedTuple):
    """How a worker was lost.

    Attributes:
        asked: what it was at.
        late: whether it was ended for not getting on with it.
        memory: whether it ended for want of memory.
        taken: by whom it had been taken, as far as known.
        hung: whether it slept while it was late: the machine may have been to blame.
        unreadable: whether it was ended for what it has sent; who is asked by then need not have written it.
        closed: whether it ended because who was asked had closed what it answers through.
    """

    asked: Asked
    late: bool = False
    memory: bool = False
    taken: Taken = Taken(NOBODY, 0.0)
    hung: bool = False
    unreadable: bool = False
    closed: bool = False


def again(jobs: Mapping[int, Job], loss: Loss) -> tuple[list[list[Job]], list[tuple[Job, Answer]]]:
    """What to do about the jobs that a lost worker has not finished.

    Args:
        jobs: these jobs.
        loss: how it was lost.

    Returns:
        groups to do again, and the jobs that are given up with their answers.
    """
    if loss.unreadable:
        loss = loss._replace(asked=loss.asked._replace(match=NOBODY, entrant=NOBODY))
    guilty = jobs.get(loss.asked.match)
    # What hangs while it is opened has had its time; in a match others are asked beside it.
    convicted = loss.late and (not loss.hung or isinstance(guilty, Opening))
    if guilty is not None and (guilty.alone or convicted):
        others = [job for job in jobs.values() if job is not guilty]
        done_again, given_up = _convict(guilty, loss)
        return [group for group in (others, done_again) if group], given_up
    if guilty is not None and not loss.memory:
        others = [job for job in jobs.values() if job is not guilty]
        return [group for group in (others, [replace(guilty, alone=True)]) if group], []
    # Nobody is blamed before it has had a worker of its own.
    groups: list[list[Job]] = [[replace(job, alone=True)] for job in jobs.values() if not job.alone]
    given_up = []
    for job in jobs.values():
        if job.alone:
            done_again, ended = _convict(job, loss)
            groups += [done_again] if done_again else []
            given_up += ended
    return groups, given_up


def _convict(job: Job, loss: Loss) -> tuple[list[Job], list[tuple[Job, Answer]]]:
    """Do a job again without the entrant that ended its worker, or give it up; see `again`."""
    entrant = loss.asked.entrant
    if loss.memory and loss.taken.entrant != NOBODY and loss.taken.size >= HOG_BYTES:
        entrant = loss.taken.entrant
    if isinstance(job, Opening):
        return [], [(job, InputError(f"{job.source}: {_why(loss)}, expected {job.expected}"))]
    if entrant == NOBODY:
        return [], [(job, Recorded(void(job.match, INTERRUPTED if loss.hung else "simulator_fault"), []))]
    ending = "timed_out" if loss.late else "policy_raised"
    why = f"{ending}, it has closed {CHANNELS}" if loss.closed else ending
    log.warning("%s: %s: its cars are out", job.match.sources[entrant], why)
    return [replace(job, absent={**job.absent, entrant: ending}, alone=False)], []


def _why(loss: Loss) -> str:
    if loss.late:
        return f"took more than {loss.asked.limit_s:g} s to open"
    if loss.closed:
        return f"has closed {CHANNELS}"
    if loss.unreadable:
        return "has spoilt what the process that opened it sends"
    return "needs more memory than there is" if loss.memory else "ended the process that opened it"
