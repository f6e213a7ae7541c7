"""The terminal: names and paths are never markup, no number is cut, and no word is broken."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

    from nathlon.terminal.rich_console import Terminal


@cache
def console(stderr: bool = False) -> Terminal:
    """A lazy console, for results or for remarks: importing rich is slow."""
    from nathlon.terminal.rich_console import Terminal

    return Terminal(stderr=stderr)


def new_table(
    title: str | None,
    columns: Iterable[str],
    words: Collection[str] = ("Entrant", "Class"),
    lean: bool = False,
) -> Table:
    """A table without rows; a lean one has a line below its head only.

    Args:
        title: above it.
        columns: their heads.
        words: heads of columns that hold words, which stand on the left: numbers stand on the right.
        lean: whether to leave out most lines.
    """
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(title=title, box=SIMPLE, padding=(0, 1, 0, 0)) if lean else Table(title=title)
    for column in columns:
        table.add_column(column, justify="left" if column in words else "right")
    return table


def print_table(table: Table) -> None:
    """Print a table, as a list where the terminal is too narrow; nothing of it is cut."""
    console().table(table)


def say(text: str) -> None:
    """Print a line; in a narrow terminal it goes on below, and words and paths stay whole."""
    console().sentence(text)


def warn(text: str) -> None:
    """Print a line that is no result to standard error, as `say` does."""
    console(stderr=True).sentence(text)


def print_json(value: Any) -> None:
    """Print plain values and paths as JSON."""
    print(json.dumps(value, indent=1, default=str))


def tell(results: Mapping[str, Any], as_json: bool) -> None:
    """Print results: as JSON, or a line for each with its name before it."""
    if as_json:
        print_json(results)
    else:
        for name, value in results.items():
            # Whole: it is a path or a command, and may be copied.
            console().print(f"{name.capitalize():<12} {value}", soft_wrap=True)
