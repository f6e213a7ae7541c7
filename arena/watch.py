"""Watching policies: a call that hangs cannot be stopped from inside its own process."""

from __future__ import annotations

import math
import os
import time
from collections import defaultdict
from collections.abc import MutableSequence
from typing import NamedTuple

from nathlon.policies.memory_limit import data_bytes
from nathlon.policies.patience import ANSWER_S, FIRST_ANSWER_S, Waiting
from nathlon.sim.process import scheduled

MATCH_S = 300.0
"""All answers of a policy in a match may take so long together, the first one apart: time in which it runs or
sleeps, and not in which it waits for a processor that others have."""
GAP_S = 1e-3
"""An answer that takes so much longer than the processor was at it has slept, or waited for a processor."""
WORK_S = 600.0
"""What the simulator may take for a tick; the first one may have to compile it."""
NOBODY = -1


class Asked(NamedTuple):
    """What a process that runs matches is at.

    Attributes:
        begun: how much it has begun so far.
        match: index of the match whose policy is asked; NOBODY where none is.
        entrant: index of the policy's entrant in that match; NOBODY where none is.
        limit_s: how long it may take.
    """

    begun: int
    match: int
    entrant: int
    limit_s: float


class Taken(NamedTuple):
    """Memory that a policy has taken and kept.

    Attributes:
        entrant: index of the policy's entrant in the match that runs; NOBODY where none has taken any.
        size: in bytes.
    """

    entrant: int
    size: float


TOLD = len(Asked._fields) + len(Taken._fields)
"""Numbers that a watch tells."""


class Watch:
    """Who is asked at the moment: told by the process that asks, read by the one that watches it.

    Args:
        answer_s, first_answer_s: time that a policy has for an answer, and for its first one.
        match_s: time that it has for all its other answers in a match together.
        told: as many numbers as `Asked` and `Taken` have, which the two processes share.
    """

    def __init__(
        self,
        answer_s: float = ANSWER_S,
        first_answer_s: float = FIRST_ANSWER_S,
        match_s: float = MATCH_S,
        told: MutableSequence[float] | None = None,
    ) -> None:
        self._answer_s, self._first_answer_s, self._match_s = answer_s, first_answer_s, match_s
        self._told = [0.0] * TOLD if told is None else told
        self._begun = 0
        self._clock: tuple[tuple[int, int], float, float] | None = None
        self.begin()

    def fall_silent(self) -> None:
        """Tell nobody any more: in a process that a policy has forked from the one that is watched."""
        self._told = list(self._told)

    def begin(self, weighs: bool = False) -> None:
        """Count anew what policies take; their memory only if asked, for one match by itself."""
        self._weighs = weighs
        self._spent_s: defaultdict[tuple[int, int], float] = defaultdict(float)
        self._taken: defaultdict[int, int] = defaultdict(int)
        self._had = data_bytes() if weighs else 0
        self._queued_s = self._queued_by_now()
        self._told[-2:] = NOBODY, 0.0
        self.rest()

    def ask(self, match: int, entrant: int, first: bool) -> None:
        """A policy is asked now, perhaps for the first time."""
        self._tell(match, entrant, self._first_answer_s if first else self._answer_s)
        if not first:
            self._clock = (match, entrant), time.perf_counter(), time.process_time()

    def work(self, limit_s: float = WORK_S) -> None:
        """The simulator is at work, or a driver that is part of it; it hangs if that takes longer, s."""
        self._tell(NOBODY, NOBODY, limit_s)

    def rest(self) -> None:
        """Nobody is asked and nothing is run."""
        self._tell(NOBODY, NOBODY, math.inf)

    def used_up(self, match: int, entrant: int) -> bool:
        """Whether a policy has used up the time that it has for a match."""
        return self._spent_s[match, entrant] > self._match_s

    def _tell(self, match: int, entrant: int, limit_s: float) -> None:
        if self._clock is not None:
            asked, clock_s, processor_s = self._clock
            took_s = time.perf_counter() - clock_s
            self._spent_s[asked] += took_s - self._waited(took_s - time.process_time() + processor_s)
            self._clock = None
        if self._weighs:
            self._weigh()
        self._begun += 1
        told = self._told
        told[0], told[1], told[2], told[3] = self._begun, match, entrant, limit_s

    def _waited(self, gap_s: float) -> float:
        """How much of the time in which an answer took no processor it may have waited for one, s."""
        if gap_s < GAP_S:
            return 0.0
        queued_s, before_s = self._queued_by_now(), self._queued_s
        self._queued_s = queued_s
        # Where the system does not tell, nobody is blamed for it.
        return gap_s if queued_s is None or before_s is None else min(gap_s, queued_s - before_s)

    def _queued_by_now(self) -> float | None:
        had = scheduled(os.getpid())
        return None if had is None else had.queued_s

    def _weigh(self) -> None:
        """Lay what memory the process has more than before to whom was asked."""
        has, entrant = data_bytes(), self.asked.entrant
        if entrant != NOBODY:
            self._taken[entrant] += has - self._had
            most = max(self._taken, key=self._taken.__getitem__)
            self._told[-2:] = most, self._taken[most]
        self._had = has

    @property
    def asked(self) -> Asked:
        """What was told last."""
        begun, match, entrant, limit_s = self._told[: len(Asked._fields)]
        return Asked(int(begun), int(match), int(entrant), limit_s)

    @property
    def taken(self) -> Taken:
        """Who has taken most memory in the match that is weighed."""
        entrant, size = self._told[-2:]
        return Taken(int(entrant), size)


class Patience:
    """How long the process behind a watch has been at the same thing; see `Waiting`."""

    def __init__(self, watch: Watch, process: int | None = None) -> None:
        self._watch, self._waiting, self._asked = watch, Waiting(process), watch.asked

    @property
    def over(self) -> bool:
        """Whether it takes longer than it may; to be looked at every LOOK_S or more often."""
        asked = self._watch.asked
        if asked != self._asked:
            self._asked = asked
            self._waiting.begin()
            return False
        return self._waiting.look() > asked.limit_s

    @property
    def asleep(self) -> bool:
        """Whether the process has slept most of that time."""
        return self._waiting.asleep
