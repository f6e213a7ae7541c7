"""The report as a spreadsheet: every number of the selection, with filters."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import polars as pl
import xlsxwriter
from xlsxwriter.utility import xl_rowcol_to_cell

from reports.selection import Selection

CREATED = datetime(2020, 1, 1)  # a constant, so that the same selection gives the same bytes
ROW_LIMIT = 50_000  # rows of a sheet; above this a spreadsheet opens too slowly to be of use
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
class _Column:
    """A column of a sheet: its name in the frame, its header with the unit, how it looks."""

    name: str
    header: str
    form: str = "General"
    width: int = 13
    scale: dict[str, Any] | None = None


ENTRANT = (_Column("name", "Entrant", width=28),)
ORIGIN = (
    _Column("step", "Training step", "#,##0"),
    _Column("seed", "Training seed", "0"),
    _Column("algorithm", "Algorithm"),
    _Column("source", "Source", width=40),
    _Column("entrant", "Checkpoint SHA-256", width=68),
)
RANKING = (
    _Column("rank", "Rank", "0", 8),
    *ENTRANT,
    _Column("points_per_race", "Points [1/race]", "0.00", scale=BLUES),
    _Column("points_low", "Points low [1/race]", "0.00"),
    _Column("points_high", "Points high [1/race]", "0.00"),
    _Column("contacts_per_km", "Contacts [1/km]", "0.000", scale=ORANGES),
    _Column("contacts_low", "Contacts low [1/km]", "0.000"),
    _Column("contacts_high", "Contacts high [1/km]", "0.000"),
    _Column("pairs", "Mirrored pairs", "#,##0"),
    _Column("races", "Races", "#,##0"),
    _Column("faults", "Faults", "#,##0"),
    *ORIGIN,
)
MATCHUPS = (
    *ENTRANT,
    _Column("opponent_name", "Opponent", width=28),
    _Column("pairs", "Mirrored pairs", "#,##0"),
    _Column("points_per_race", "Points [1/race]", "0.00"),
    _Column("difference", "Difference [points/race]", "+0.00;-0.00;0.00", 15, DIVERGING),
    _Column("difference_low", "Difference low [points/race]", "+0.00;-0.00;0.00", 15),
    _Column("difference_high", "Difference high [points/race]", "+0.00;-0.00;0.00", 15),
    _Column("contacts_per_km", "Contacts [1/km]", "0.000", scale=ORANGES),
)
PARETO = (
    *ENTRANT,
    _Column("lap_s", "Lap [s]", "0.000", scale=ORANGES),
    _Column("off_course_share", "Off course [share of time]", "0.00%", scale=ORANGES),
    _Column("contacts_per_km", "Contacts [1/km]", "0.000", scale=ORANGES),
    _Column("nondominated_probability", "Non-dominated [probability]", "0.0%", 15, BLUES),
    _Column("survives", "Survives"),
    _Column("races", "Races", "#,##0"),
    *ORIGIN,
)
RACES = (
    *ENTRANT,
    _Column("stage", "Stage"),
    _Column("test", "Test", width=18),
    _Column("race", "Race", "0", 8),
    _Column("seed", "Race seed", "0"),
    _Column("mirrored", "Mirrored"),
    _Column("car", "Car", "0", 8),
    _Column("slot", "Starting place", "0"),
    _Column("team", "Team", "0", 8),
    _Column("place", "Place", "0", 8),
    _Column("points", "Points", "0.##"),
    _Column("laps", "Laps", "0", 8),
    _Column("ending", "Ending", width=15),
    _Column("race_time_s", "Race time [s]", "0.000"),
    _Column("driven_s", "Driven [s]", "0.0"),
    _Column("distance_m", "Distance [m]", "#,##0"),
    _Column("best_lap_s", "Best lap [s]", "0.000"),
    _Column("off_course_s", "Off course [s]", "0.0"),
    _Column("wall_s", "Wall contact [s]", "0.0"),
    _Column("contacts", "Contacts", "0"),
    _Column("contacts_faster_behind", "Contacts from behind", "0"),
    _Column("match", "Match", width=34),
    _Column("entrant", "Checkpoint SHA-256", width=68),
)


def write_spreadsheet(selection: Selection, path: Path) -> Path:
    """Write the workbook, whole or not at all, and return its path.

    Sheets: Ranking, Skills, Matchups, Pareto, Races, Run. No text of the selection becomes a formula or
    a link. Races holds at most `ROW_LIMIT` rows, the last stages first; Run counts the rows left out.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    try:
        _write(selection, partial)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    return path


def _write(selection: Selection, path: Path) -> None:
    plain_text = {"strings_to_formulas": False, "strings_to_urls": False, "strings_to_numbers": False}
    names = selection.tables["entrants"].select("entrant", "name")
    opponents = names.rename({"entrant": "opponent", "name": "opponent_name"})
    with xlsxwriter.Workbook(str(path), plain_text) as workbook:
        workbook.set_properties({"title": selection.title, "created": CREATED})
        ranking = selection.named("ranking").sort(["rank", "points_per_race"], descending=[False, True])
        _sheet(workbook, "Ranking", RANKING, ranking)
        _skills(workbook, selection)
        matchups = selection.named("matchups").join(
            opponents, on="opponent", how="left", maintain_order="left"
        )
        _sheet(workbook, "Matchups", MATCHUPS, matchups)
        pareto = selection.named("pareto").sort(
            ["survives", "lap_s"], descending=[True, False], nulls_last=True
        )
        _sheet(workbook, "Pareto", PARETO, pareto)
        races = selection.results.join(names, on="entrant", how="left", maintain_order="left").with_columns(
            name=pl.coalesce("name", "entrant")  # a fixed opponent is no entrant
        )
        latest = ["race", "tournament", "battery", "pareto"]
        races = races.sort(pl.col("stage").replace_strict(latest, range(4), default=4), maintain_order=True)
        _sheet(workbook, "Races", RACES, races.head(ROW_LIMIT).fill_nan(None))
        _run(workbook, selection, left_out=max(0, races.height - ROW_LIMIT))


def _sheet(workbook: Any, title: str, columns: tuple[_Column, ...], frame: pl.DataFrame) -> Any:
    """A sheet that holds the frame as an Excel table; header and entrant's name stay in view."""
    sheet = _table(workbook, title, [column.header for column in columns], frame.height)
    sheet.freeze_panes(1, 1 + [column.name for column in columns].index("name"))
    sheet.set_row(0, 32)
    for at, column in enumerate(columns):
        form = workbook.add_format({"num_format": column.form})
        sheet.set_column(at, at, column.width)
        for row, value in enumerate(frame[column.name].to_list(), start=1):
            _cell(sheet, row, at, value, form)
        if column.scale and frame.height:
            sheet.conditional_format(1, at, frame.height, at, column.scale)
    return sheet


def _table(workbook: Any, title: str, headers: Sequence[str], rows: int) -> Any:
    sheet = workbook.add_worksheet(title)
    form = workbook.add_format({"bold": True, "text_wrap": True, "valign": "top", "bottom": 1})
    table = {
        "name": f"{title}Table",
        "style": "Table Style Light 1",
        "banded_rows": False,
        "columns": [{"header": header, "header_format": form} for header in headers],
    }
    sheet.add_table(0, 0, max(1, rows), len(headers) - 1, table)  # Excel refuses a table without a row
    sheet.set_landscape()
    sheet.repeat_rows(0)
    sheet.fit_to_pages(1, 0)
    return sheet


def _cell(sheet: Any, row: int, at: int, value: Any, form: Any) -> None:
    if value is None:
        sheet.write_blank(row, at, None, form)
    elif isinstance(value, str):
        sheet.write_string(row, at, value, form)
    elif isinstance(value, bool):
        sheet.write_boolean(row, at, value, form)
    else:
        sheet.write_number(row, at, value, form)


def _skills(workbook: Any, selection: Selection) -> None:
    """One row an entrant and one column a test; the sum is a formula over the tests."""
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
        .sort(["rank", "points"], descending=[False, True])
    )
    columns = (
        _Column("rank", "Rank", "0", 8),
        *ENTRANT,
        *(_Column(f"points {test}", f"{test} [points]", "0.0", 12) for test in tests),
        _Column("sum", "Sum [points]", "0.0", scale=BLUES),
        _Column("points_low", "Sum low [points]", "0.0"),
        _Column("points_high", "Sum high [points]", "0.0"),
        _Column("shortlisted", "Shortlisted"),
        *ORIGIN,
    )
    sheet = _sheet(workbook, "Skills", columns, frame)
    if not tests or frame.is_empty():
        return
    first, total = 2, 2 + len(tests)
    sheet.conditional_format(1, first, frame.height, total - 1, BLUES)
    form = workbook.add_format({"num_format": "0.0", "bold": True})
    for row, value in enumerate(frame["sum"].to_list(), start=1):
        cells = f"{xl_rowcol_to_cell(row, first)}:{xl_rowcol_to_cell(row, total - 1)}"
        sheet.write_formula(row, total, f"=SUM({cells})", form, value or 0.0)


def _run(workbook: Any, selection: Selection, left_out: int) -> None:
    summary = selection.summary
    facts: list[tuple[str, Any]] = [
        ("Title", selection.title),
        ("Circuit", summary["circuit"]),
        ("Car", summary["car"]),
        ("Seed", summary["seed"]),
        ("Confidence of intervals", summary["confidence"]),
        ("Correlation within mirrored pairs", summary["pair_correlation"]),
        ("Car runs ended by a policy's fault", summary["faults"]),
        ("Replay", summary["replay"]),
        ("Recording", summary["recording"]),
        ("Rows left out of Races", left_out),
    ]
    for stage in summary["stages"]:
        name = str(stage["name"]).capitalize()
        facts += [
            (f"{name}: entrants in", stage["in"]),
            (f"{name}: entrants out", stage["out"]),
            (f"{name}: races", stage["races"]),
            (f"{name}: time [s]", stage["wall_s"]),
        ]
    facts += [(f"Version of {name}", version) for name, version in sorted(summary["versions"].items())]
    sheet = _table(workbook, "Run", ["Fact", "Value"], len(facts))
    left = workbook.add_format({"align": "left"})
    sheet.freeze_panes(1, 0)
    sheet.set_column(0, 0, 36)
    sheet.set_column(1, 1, 48)
    for row, (fact, value) in enumerate(facts, start=1):
        sheet.write_string(row, 0, fact)
        _cell(sheet, row, 1, value, left)
