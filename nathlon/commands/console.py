"""The terminal."""

from __future__ import annotations

import os

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

console = Console()


def say(text: str) -> None:
    """Print a line as it is: paths stay whole, and nothing in them is markup."""
    console.print(text, markup=False, highlight=False, soft_wrap=True)


def worker_count(asked: int | None) -> int:
    """Processes to use: as asked, or one for each core."""
    return asked or os.cpu_count() or 1


def progress_bars(quiet: bool = False) -> Progress:
    """Bars with a note, the time taken and the time to go; nothing is shown if quiet."""
    return Progress(
        TextColumn("{task.description:<12}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[note]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        disable=quiet,
    )
