"""The terminal."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from nathlon.sim.names import printable


class Terminal(Console):
    """A console on which text is text: nothing in names or paths is markup, an emoji or a control code."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, markup=False, emoji=False, highlight=False)

    def render_str(self, text: str, **options: Any) -> Text:
        """See `Console.render_str`."""
        return super().render_str(printable(text), **options)


console = Terminal()
_aside = Terminal(stderr=True)


def say(text: str) -> None:
    """Print a line as it is: paths stay whole."""
    console.print(text, soft_wrap=True)


def warn(text: str) -> None:
    """Print a line that is no result to standard error, as it is."""
    _aside.print(text, soft_wrap=True)


def print_json(value: Any) -> None:
    """Print plain values and paths as JSON."""
    print(json.dumps(value, indent=1, default=str))


def tell(results: Mapping[str, Any], as_json: bool) -> None:
    """Print results: as JSON, or a line for each with its name before it."""
    if as_json:
        print_json(results)
    else:
        for name, value in results.items():
            say(f"{name.capitalize():<12} {value}")


def worker_count(asked: int | None) -> int:
    """Processes to use: as asked, or one for each core."""
    return asked or os.cpu_count() or 1


def progress_bars(quiet: bool = False) -> Progress:
    """Bars with a note, the time taken and the time to go; nothing is shown if quiet."""
    return Progress(
        TextColumn("{task.description:<12}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[note]}", markup=False),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        disable=quiet,
    )
