"""A console on which names and paths are never markup, and tables never cut."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from nathlon.sim.names import printable

WIDEST = 10_000
"""Letters in a line of a table."""


class Terminal(Console):
    """A console on which text is text: nothing in names or paths is markup, an emoji or a control code."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, markup=False, emoji=False, highlight=False)

    def table(self, table: Table) -> None:
        """Print a table; one that is wider than the terminal goes on beyond its edge, and nothing is cut."""
        for column in table.columns:
            column.no_wrap = True
        needed = Measurement.get(self, self.options.update(max_width=WIDEST), table).maximum
        own, self.width = self.width, max(self.width, needed)
        try:
            self.print(table)
        finally:
            self.width = own

    def render_str(self, text: str, **options: Any) -> Text:
        """See `Console.render_str`."""
        return super().render_str(printable(text), **options)
