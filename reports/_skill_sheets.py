"""The n-athlon in the spreadsheet: its points, and the order that follows from weights of the tests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import polars as pl
from xlsxwriter.utility import xl_range, xl_range_abs, xl_rowcol_to_cell

from nathlon.reports._sheets import BLUES, ENTRANT, RANK, Column, add_table, write_cell, write_sheet
from nathlon.results.selection import Selection

WEIGHTS = 0
"""The row of the weights, above the table; the first row of the table's body is FIRST."""
FIRST = 2
NAME, TESTS = 0, 1
"""Columns of the entrants' names and of the first test."""


@dataclass(frozen=True)
class SkillSheet:
    """Where things are on the sheet.

    Attributes:
        names, sums: of the entrants, from top to bottom, by descending sums.
        tests: how many.
    """

    names: list[str]
    sums: list[float]
    tests: int

    def column(self, at: int) -> str:
        """The body of a column, as other sheets refer to it."""
        return f"Skills!{xl_range_abs(FIRST, at, FIRST + len(self.names) - 1, at)}"

    @property
    def weighted(self) -> int:
        """The column of the weighted sum; the place follows it."""
        return TESTS + self.tests + 1


def write_skills(workbook: Any, selection: Selection) -> SkillSheet:
    """One row an entrant and one column a test, with a weight above each; sums and places are formulas."""
    skills = selection.tables["skills"].fill_nan(None)
    tests = skills["test"].unique(maintain_order=True).to_list()
    wide = skills.pivot("test", index="entrant", values="points").rename(
        {test: f"points {test}" for test in tests}
    )
    sums = wide.select("entrant", sum=pl.sum_horizontal(pl.exclude("entrant")) if tests else pl.lit(0.0))
    frame = (
        selection.named("battery")
        .join(wide, on="entrant", how="left", maintain_order="left")
        .join(sums, on="entrant", how="left", maintain_order="left")
        .with_columns(pl.col("sum").fill_null(0.0))
        .sort("sum", "name", descending=[True, False])
        .with_columns(weighted="sum", place=pl.int_range(1, pl.len() + 1))
    )
    columns = (
        *ENTRANT,
        *(Column(f"points {test}", f"{test.replace('_', ' ')} [points]", "0", 12) for test in tests),
        Column("sum", "Sum [points]", "#,##0", scale=BLUES),
        Column("weighted", "Weighted sum [points]", "#,##0", scale=BLUES),
        Column("place", "Weighted place", "0", 10),
        RANK,
        Column("points_low", "Sum low [points]", "#,##0"),
        Column("points_high", "Sum high [points]", "#,##0"),
        Column("shortlisted", "Shortlisted"),
    )
    sheet = write_sheet(workbook, "Skills", columns, frame, top=FIRST - 1)
    written = SkillSheet(frame["name"].to_list(), frame["sum"].to_list(), len(tests))
    if tests and written.names:
        sheet.conditional_format(FIRST, TESTS, FIRST + len(written.names) - 1, len(tests), BLUES)
        _write_weights(workbook, sheet, written)
        _write_sums(workbook, sheet, written)
    return written


def _write_weights(workbook: Any, sheet: Any, skills: SkillSheet) -> None:
    label = workbook.add_format({"bold": True, "align": "right"})
    entry = workbook.add_format({"num_format": "0.0#", "bg_color": "#FFF6D6", "border": 1})
    sheet.write_string(WEIGHTS, NAME, "Weights, to change:", label)
    for at in range(TESTS, TESTS + skills.tests):
        sheet.write_number(WEIGHTS, at, 1.0, entry)


def _write_sums(workbook: Any, sheet: Any, skills: SkillSheet) -> None:
    points = workbook.add_format({"num_format": "#,##0", "bold": True, "align": "right"})
    whole = workbook.add_format({"num_format": "0", "align": "right"})
    last, weighted = TESTS + skills.tests - 1, skills.weighted
    weights = xl_range_abs(WEIGHTS, TESTS, WEIGHTS, last)
    everybody = xl_range_abs(FIRST, weighted, FIRST + len(skills.names) - 1, weighted)
    for place, total in enumerate(skills.sums, start=1):
        row = FIRST + place - 1
        own, cell = xl_range(row, TESTS, row, last), xl_rowcol_to_cell(row, weighted)
        above = f"{xl_rowcol_to_cell(FIRST, weighted, row_abs=True)}:{cell}"
        sheet.write_formula(row, weighted - 1, f"=SUM({own})", points, total)
        sheet.write_formula(row, weighted, f"=SUMPRODUCT({weights},{own})", points, total)
        # Equal sums get places one after the other, so that every place is taken once.
        sheet.write_formula(
            row, weighted + 1, f"=RANK({cell},{everybody})+COUNTIF({above},{cell})-1", whole, place
        )


def write_weighted(workbook: Any, skills: SkillSheet) -> None:
    """The entrants in the order of their weighted sums, which moves when a weight is changed."""
    columns = (
        Column("place", "Place", "0", 8),
        *ENTRANT,
        Column("weighted", "Weighted sum [points]", "#,##0", 16),
        Column("gained", "Places gained by the weights", "+0;-0;0", 16),
    )
    heads = [(column.header, column.look) for column in columns]
    sheet = add_table(workbook, "Weighted", heads, len(skills.names))
    sheet.freeze_panes(1, 2)
    for at, column in enumerate(columns):
        sheet.set_column(at, at, column.width)
    forms = [workbook.add_format({"num_format": column.form, **column.look}) for column in columns]
    places = skills.column(skills.weighted + 1)
    for place, (name, total) in enumerate(zip(skills.names, skills.sums, strict=True), start=1):
        write_cell(sheet, place, 0, place, forms[0])
        if not skills.tests:
            continue
        found = f"MATCH({xl_rowcol_to_cell(place, 0)},{places},0)"
        sheet.write_formula(place, 1, f"=INDEX({skills.column(NAME)},{found})", forms[1], name)
        sheet.write_formula(place, 2, f"=INDEX({skills.column(skills.weighted)},{found})", forms[2], total)
        sheet.write_formula(place, 3, f"={found}-{xl_rowcol_to_cell(place, 0)}", forms[3], 0)
