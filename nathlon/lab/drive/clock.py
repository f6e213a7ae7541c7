"""The clock by which a race runs as fast as the time of day."""

from __future__ import annotations

import time
from collections.abc import Callable

from nathlon.sim.clock import DYNAMICS_DT

FURTHEST_BEHIND_S = 0.1
"""A world that is further behind loses the time: it would race to make up for it."""


class Clock:
    """Absolute deadlines, one a dynamics step.

    Attributes:
        late_s: how late each step began, s.

    Args:
        now: seconds that never go back.
        sleep: waits for some seconds.
    """

    def __init__(
        self, now: Callable[[], float] = time.monotonic, sleep: Callable[[float], object] = time.sleep
    ) -> None:
        self._now, self._sleep = now, sleep
        self.late_s: list[float] = []
        self.start()

    def start(self, in_s: float = 0.0) -> None:
        """Have the next step begin in so many seconds, and the others after it."""
        self._due = self._now() + in_s

    def rest(self, seconds: float) -> None:
        """Let time go by."""
        self._sleep(seconds)

    def wait(self) -> None:
        """Wait until the next step is due."""
        while (left_s := self._due - self._now()) > 0.0:
            self._sleep(left_s)
        self.late_s.append(-left_s)
        if -left_s > FURTHEST_BEHIND_S:
            self._due = self._now()
        self._due += DYNAMICS_DT
