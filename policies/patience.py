"""What a process in which policies run is granted, and how long it has been at something."""

from __future__ import annotations

import time

from nathlon.sim.errors import InputError
from nathlon.sim.process import scheduled

ANSWER_S = 10.0
"""A policy that has not answered for so long has timed out: a hundred times what is between two ticks."""
FIRST_ANSWER_S = 120.0
"""Its first answer may take longer, and so may its loading: libraries start and compile."""
WORLD_OPENS_S = 100.0
"""A world in another interpreter has so long to begin, and for every reset: simulators load their assets."""
WORLD_ANSWER_S = 60.0
"""One that has not made a step for so long hangs."""
LOOK_S = 1.0
"""Between two looks at a process, at most."""


class TimedOutError(InputError):
    """A policy has not answered in time."""


class Waiting:
    """How long a process has been at the same thing, by its own doing.

    Time in which it runs or sleeps counts, and not that in which it waits for a processor that others have.
    Nor does time in which nobody looks: this process may have been stopped, and the other one with it.
    """

    def __init__(self, process: int | None) -> None:
        """For a process of this machine; of None the clock counts, as where the system tells nothing."""
        self._process = process
        self.begin()

    def begin(self) -> None:
        """It is at something else from now on."""
        self._watched_s, self._looked = 0.0, time.monotonic()
        self._before = self._now = None if self._process is None else scheduled(self._process)

    def look(self) -> float:
        """For how long it has been at it, s; to be asked every LOOK_S or more often."""
        now = time.monotonic()
        self._watched_s += min(now - self._looked, LOOK_S)
        self._looked = now
        if self._process is not None:
            self._now = scheduled(self._process) or self._now
        if self._before is None or self._now is None:
            return self._watched_s
        return max(0.0, self._watched_s - (self._now.queued_s - self._before.queued_s))

    @property
    def asleep(self) -> bool:
        """Whether it has not run for most of that time, as far as is known: it may hang, or the machine."""
        if self._before is None or self._now is None:
            return True
        return self._now.ran_s - self._before.ran_s < self._watched_s / 2
