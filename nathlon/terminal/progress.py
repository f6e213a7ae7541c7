"""Progress of the stages of a selection: bars on a terminal and in a notebook, else lines."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from nathlon.results.words import counted, stage_called
from nathlon.terminal import console, warn

if TYPE_CHECKING:
    from nathlon.selection.run import OnMatch


def worker_count(asked: int | None) -> int:
    """Processes to use: as asked, or one for each core."""
    return asked or os.cpu_count() or 1


def progress_bars(shown: bool = True) -> Progress:
    """Bars with a note, the time taken and the time to go, on standard error; nothing unless shown."""
    return Progress(
        TextColumn("{task.description:<12}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[note]}", markup=False),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console(stderr=True),
        disable=not shown,
    )


def _somebody_looks() -> bool:
    """Whether standard error is a terminal, or this is a notebook."""
    return console(stderr=True).is_terminal or console(stderr=True).is_jupyter


@contextmanager
def busy(doing: str, shown: bool) -> Iterator[None]:
    """Show on a terminal, and in a notebook, for how long something goes on of which nothing is counted."""
    columns = SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn()
    seen = shown and _somebody_looks()
    with Progress(*columns, console=console(stderr=True), transient=True, disable=not seen) as bars:
        bars.add_task(doing, total=None)
        yield


@contextmanager
def stage_progress(shown: bool, stages: Sequence[str] | None = None) -> Iterator[OnMatch]:
    """Show the stages that have begun, unless told not to.

    Args:
        shown: whether to.
        stages: that there may be; those of a selection by default.

    Yields:
        what is to be told of matches that have ended.
    """
    from nathlon.selection.run import (  # loads the store
        INCIDENT_RUNS,
        KERNELS,
        OPENED,
        RECORDINGS,
        STAGES,
        TIMES,
    )

    if shown and not _somebody_looks():
        lines = _Lines()
        try:
            yield lines.on_match
        finally:
            lines.end()
        return
    with progress_bars(shown) as bars:
        tasks = {
            stage: bars.add_task(stage_called(stage), total=None, note=_counted(stage), visible=False)
            for stage in stages or (OPENED, KERNELS, *STAGES, INCIDENT_RUNS, TIMES, RECORDINGS)
        }

        def on_match(stage: str, done: int, total: int) -> None:
            bars.update(tasks[stage], completed=done, total=total, visible=True)

        yield on_match


ONE = {"matches": "match", "policies": "policy", "legs": "leg"}
"""Of what is counted, by what several are called."""
LINE_S = 60.0
"""Between two lines of a stage that goes on."""


class _Lines:
    """A line for every stage, every minute and once it is over; a stage may ask for matches several times."""

    def __init__(self) -> None:
        self._stage: str | None = None
        self._before = self._done = 0
        self._began = self._told = 0.0

    def on_match(self, stage: str, done: int, total: int) -> None:
        if stage != self._stage:
            self.end()
            self._stage, self._before, self._done = stage, 0, 0
            self._began = self._told = time.monotonic()
        elif done < self._done:
            self._before += self._done
        self._done = done
        if time.monotonic() - self._told > LINE_S:
            self._tell(stage, "after")
            self._told = time.monotonic()

    def end(self) -> None:
        from nathlon.selection.run import OPENED

        # That files were opened is worth a line only where it took long.
        if self._stage is not None and (self._stage != OPENED or self._told > self._began):
            self._tell(self._stage, "in")
        self._stage = None

    def _tell(self, stage: str, when: str) -> None:
        several = _counted(stage)
        ended = counted(self._before + self._done, ONE.get(several, several), several).rstrip()
        warn(f"{stage_called(stage).capitalize():<12} {ended} {when} {time.monotonic() - self._began:.0f} s")


def _counted(stage: str) -> str:
    """What is counted in a stage; one that is called as it counts says so once."""
    from nathlon.selection.run import KERNELS, OPENED, TIMES

    return {
        KERNELS: "compiled",
        OPENED: "policies",
        TIMES: "policies",
        "drives": "",
        "races": "",
        "race": "legs",
        "practice": "policies",
    }.get(stage, "matches")
