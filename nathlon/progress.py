"""Progress of the stages of a selection: bars on a terminal and in a notebook, a line a stage elsewhere."""

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
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

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


@contextmanager
def stage_progress(shown: bool, stages: Sequence[str] | None = None) -> Iterator[OnMatch]:
    """Show the stages that have begun, unless told not to.

    Args:
        shown: whether to.
        stages: that there may be; those of a selection by default.

    Yields:
        what is to be told of matches that have ended.
    """
    from nathlon.selection.run import INCIDENT_RUNS, KERNELS, RECORDINGS, STAGES  # loads the store

    if shown and not (console(stderr=True).is_terminal or console(stderr=True).is_jupyter):
        lines = _Lines()
        try:
            yield lines.on_match
        finally:
            lines.end()
        return
    with progress_bars(shown) as bars:
        tasks = {
            stage: bars.add_task(stage, total=None, note=_counted(stage), visible=False)
            for stage in stages or (KERNELS, *STAGES, INCIDENT_RUNS, RECORDINGS)
        }

        def on_match(stage: str, done: int, total: int) -> None:
            bars.update(tasks[stage], completed=done, total=total, visible=True)

        yield on_match


class _Lines:
    """A line for every stage, once it is over; a stage may ask for matches several times."""

    def __init__(self) -> None:
        self._stage: str | None = None
        self._before = self._done = 0
        self._began = 0.0

    def on_match(self, stage: str, done: int, total: int) -> None:
        if stage != self._stage:
            self.end()
            self._stage, self._before, self._done, self._began = stage, 0, 0, time.monotonic()
        elif done < self._done:
            self._before += self._done
        self._done = done

    def end(self) -> None:
        if self._stage is not None:
            seconds = time.monotonic() - self._began
            ended = f"{self._before + self._done:,} {_counted(self._stage)}".rstrip()
            warn(f"{self._stage.capitalize():<12} {ended} in {seconds:.0f} s")
        self._stage = None


def _counted(stage: str) -> str:
    """What is counted in a stage; one that is called as it counts says so once."""
    from nathlon.selection.run import KERNELS

    return {KERNELS: "compiled", "drives": "", "races": ""}.get(stage, "matches")
