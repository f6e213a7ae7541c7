"""A console on which names and paths are never markup, tables never cut, and words never broken."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

from rich.cells import cell_len
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from nathlon.sim.names import printable

WIDEST = 10_000
"""Letters in a line of a table."""
LABEL = re.compile(r" *(\S.{0,19}?)?  +(?=\S)")
"""What stands before a text that goes on below itself: a name and a gap."""
INDENT = "    "
BETWEEN = "   "
"""Two figures of a list."""


class Terminal(Console):
    """A console on which text is text: nothing in names or paths is markup, an emoji or a control code."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, markup=False, emoji=False, highlight=False)

    def table(self, table: Table) -> None:
        """Print a table; one that is wider than the terminal becomes a list, and nothing is cut.

        Without a terminal, in a pipe for instance, every table is as wide as it needs to be.
        """
        for column in table.columns:
            column.no_wrap = True
        needed = Measurement.get(self, self.options.update(max_width=WIDEST), table).maximum
        if self.is_terminal and needed > self.width:
            for line in _as_list(table, self.width):
                self.sentence(line)
            return
        own, self.width = self.width, max(self.width, needed)
        try:
            self.print(table)
        finally:
            self.width = own

    def sentence(self, text: str) -> None:
        """Print a line; one that is wider than the terminal goes on below, never within a word or a path."""
        if not self.is_terminal or cell_len(text) <= self.width:
            self.print(text, soft_wrap=True)
            return
        label = found[0] if (found := LABEL.match(text)) else ""
        for line in _filled(label, printable(text[len(label) :]).split(" "), " ", self.width):
            self.print(line, soft_wrap=True)

    def render_str(self, text: str, **options: Any) -> Text:
        """See `Console.render_str`."""
        return super().render_str(printable(text), **options)


def _as_list(table: Table, width: int) -> Iterator[str]:
    """The lines of a list instead of a table: every row's name, and below it the figures with their heads."""
    if table.title:
        yield str(table.title)
    heads = [str(column.header).replace("\n", " ") for column in table.columns]
    name = next((i for i, column in enumerate(table.columns) if heads[i] and column.justify == "left"), 0)
    for row in zip(*(column.cells for column in table.columns), strict=True):
        cells = [cell.plain if isinstance(cell, Text) else str(cell) for cell in row]
        marks = [cell for head, cell in zip(heads, cells, strict=True) if not head and cell]
        yield " ".join([*marks, cells[name]])
        told = [(head, cell) for i, (head, cell) in enumerate(zip(heads, cells, strict=True)) if i != name]
        figures = [f"{head} {cell}" for head, cell in told if head and cell]
        yield from _filled(INDENT, figures, BETWEEN, width)


def _filled(start: str, parts: Sequence[str], between: str, width: int) -> Iterator[str]:
    """Lines of whole parts, as wide as allowed; after the first, they begin below the end of `start`."""
    line, empty = start, True
    for part in parts:
        if not empty and cell_len(line + between + part) > width:
            yield line
            line, empty = " " * cell_len(start), True
        line, empty = f"{line}{'' if empty else between}{part}", False
    if not empty:
        yield line
