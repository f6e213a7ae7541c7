"""The parts that every sheet of the spreadsheet is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl

A4 = 9
PRINTED_ROWS = 60
HEADER = 48
"""Height of a header of two lines, points: what opens a filter lies below them."""
TEXT = "General"
"""The form of cells that hold no number."""
EXACT = 2**53
"""Whole numbers up to which a cell, which is a float, holds all."""
BLUES = {"type": "2_color_scale", "min_color": "#FFFFFF", "max_color": "#6BA3D6"}
ORANGES = {"type": "2_color_scale", "min_color": "#FFFFFF", "max_color": "#E9A15B"}
DIVERGING = {
    "type": "3_color_scale",
    "mid_type": "num",
    "mid_value": 0,
    "min_color": "#E9A15B",
    "mid_color": "#FFFFFF",
    "max_color": "#6BA3D6",
}


@dataclass(frozen=True)
class Column:
    """A column of a sheet: its name in the frame, its header with the unit, how it looks.

    A whole number is shown as the beginning of a range up to that of the column `up_to`, and stays a number.
    """

    name: str
    header: str
    form: str = TEXT
    width: int = 13
    scale: dict[str, Any] | None = None
    up_to: str | None = None

    @property
    def look(self) -> dict[str, Any]:
        """How header and cells are aligned: numbers to the right, texts apart from a number before."""
        return {"align": "right"} if self.form != TEXT else {"align": "left", "indent": 1}


RANK = Column("rank", "Rank", "0", 9, up_to="worst_rank")
ENTRANT = (Column("name", "Entrant", width=28),)
ORIGIN = (
    Column("step", "Training step", "#,##0"),
    Column("seed", "Training seed", "0"),
    Column("algorithm", "Algorithm"),
    Column("source", "Source", width=40),
    Column("entrant", "Checkpoint SHA-256", width=68),
)


def write_sheet(
    workbook: Any, title: str, columns: tuple[Column, ...], frame: pl.DataFrame, top: int = 0
) -> Any:
    """A sheet that holds the frame as a table below `top` rows; header and entrant's name stay in view."""
    heads = [(column.header, column.look) for column in columns]
    sheet = add_table(workbook, title, heads, frame.height, top)
    sheet.freeze_panes(top + 1, 1 + [column.name for column in columns].index("name"))
    first, last = top + 1, top + frame.height
    for at, column in enumerate(columns):
        shown = _forms(column, frame)
        forms = {form: workbook.add_format({"num_format": form, **column.look}) for form in set(shown)}
        sheet.set_column(at, at, column.width)
        for row, (value, form) in enumerate(
            zip(frame[column.name].to_list(), shown, strict=True), start=first
        ):
            write_cell(sheet, row, at, value, forms[form])
        if column.scale and frame.height:
            sheet.conditional_format(first, at, last, at, column.scale)
    return sheet


def _forms(column: Column, frame: pl.DataFrame) -> list[str]:
    """The form of each cell of a column."""
    if column.up_to is None:
        return [column.form] * frame.height
    return [
        column.form if worst == best else '"from "0' if worst is None else f'0" to {worst}"'
        for best, worst in frame.select(column.name, column.up_to).iter_rows()
    ]


def add_table(
    workbook: Any, title: str, headers: Sequence[tuple[str, dict[str, Any]]], rows: int, top: int = 0
) -> Any:
    """A sheet with a table that has no cells yet but its headers, each with how it is aligned."""
    sheet = workbook.add_worksheet(title)
    sheet.set_row(top, HEADER)
    plain = {"bold": True, "text_wrap": True, "valign": "top", "bottom": 1}
    table = {
        "name": f"{title}Table",
        "style": "Table Style Light 1",
        "banded_rows": False,
        "columns": [
            {"header": header, "header_format": workbook.add_format({**plain, **look})}
            for header, look in headers
        ],
    }
    # Excel refuses a table without a row.
    sheet.add_table(top, 0, top + max(1, rows), len(headers) - 1, table)
    sheet.set_landscape()
    sheet.set_paper(A4)
    sheet.set_footer(f"&L{title}&RPage &P of &N")
    sheet.repeat_rows(top)
    # Who prints the workbook wants the first of each table, not a page for every hundred races.
    sheet.print_area(0, 0, top + min(max(1, rows), PRINTED_ROWS), len(headers) - 1)
    sheet.fit_to_pages(1, 0)
    return sheet


def write_cell(sheet: Any, row: int, at: int, value: Any, form: Any) -> None:
    """A value as what it is: text never becomes a formula, a number or a link.

    What is true or not is told in words: programs show it as different things. Whole numbers beyond what a
    cell holds exactly, as of seeds, are text.
    """
    if value is None:
        sheet.write_blank(row, at, None, form)
    elif isinstance(value, str):
        sheet.write_string(row, at, value, form)
    elif isinstance(value, bool):
        sheet.write_string(row, at, "yes" if value else "no", form)
    elif isinstance(value, int) and abs(value) > EXACT:
        sheet.write_string(row, at, str(value), form)
    else:
        sheet.write_number(row, at, value, form)
