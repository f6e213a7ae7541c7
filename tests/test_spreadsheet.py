from __future__ import annotations

from pathlib import Path

import numpy as np
import openpyxl
import polars as pl
import pytest

import reports.spreadsheet
from reports.selection import Selection
from reports.spreadsheet import write_spreadsheet
from tests.selections import TESTS, build, with_tables

SHEETS = ["Ranking", "Skills", "Matchups", "Pareto", "Races", "Run"]
HOSTILE = ("=1+1", "+1", "-1", "@SUM(A1)", "=cmd|' /C calc'!A0", "{=1+1}", "https://example.org", "42")


def _rows(path: Path, sheet: str, formulas: bool = False) -> list[dict[str, object]]:
    values = openpyxl.load_workbook(path, data_only=not formulas)[sheet].iter_rows(values_only=True)
    header = [str(name) for name in next(values)]
    return [dict(zip(header, row, strict=True)) for row in values]


@pytest.fixture
def selection() -> Selection:
    return build(np.random.default_rng(0), entrants=80, finalists=5)


def test_values_and_table_ranges(selection: Selection, tmp_path: Path) -> None:
    path = write_spreadsheet(selection, tmp_path / "report" / "ranking.xlsx")
    book = openpyxl.load_workbook(path)
    assert book.sheetnames == SHEETS
    heights = [selection.tables[name].height for name in ("ranking", "battery", "matchups", "pareto")]
    for name, height in zip(SHEETS[:5], [*heights, selection.results.height], strict=True):
        (table,) = book[name].tables.values()
        assert table.ref == book[name].dimensions
        assert book[name].max_row == height + 1
        assert table.autoFilter is not None
        assert book[name].freeze_panes is not None
    ranking = selection.named("ranking").sort(["rank", "points_per_race"], descending=[False, True])
    read = _rows(path, "Ranking")
    assert [row["Entrant"] for row in read] == ranking["name"].to_list()
    assert [row["Points [1/race]"] for row in read] == pytest.approx(ranking["points_per_race"].to_list())
    assert [row["Contacts low [1/km]"] for row in read] == pytest.approx(ranking["contacts_low"].to_list())
    pareto = _rows(path, "Pareto")
    assert (
        sum(row["Lap [s]"] is None for row in pareto) == selection.tables["pareto"]["lap_s"].null_count() > 0
    )
    assert sum(row["Survives"] is True for row in pareto) == selection.tables["pareto"]["survives"].sum()
    matchup = _rows(path, "Matchups")[0]
    first = selection.tables["matchups"].row(0, named=True)
    assert matchup["Difference [points/race]"] == pytest.approx(first["difference"])
    run = {row["Fact"]: row["Value"] for row in _rows(path, "Run")}
    assert run["Seed"] == 7
    assert run["Pareto: entrants in"] == 80
    assert run["Version of torch"] == "2.9.1"


def test_sums_are_formulas_with_their_values(selection: Selection, tmp_path: Path) -> None:
    path = write_spreadsheet(selection, tmp_path / "ranking.xlsx")
    sums = {row["Entrant"]: row["Sum [points]"] for row in _rows(path, "Skills")}
    expected = selection.named("battery").select("name", "points").rows()
    assert sums == {name: pytest.approx(points) for name, points in expected}
    for number, row in enumerate(_rows(path, "Skills", formulas=True), start=2):
        assert row["Sum [points]"] == f"=SUM(C{number}:H{number})"
        assert list(row)[2:8] == [f"{test} [points]" for test in TESTS]


def test_hostile_names_are_text(selection: Selection, tmp_path: Path) -> None:
    count = selection.tables["entrants"].height
    names = [HOSTILE[i % len(HOSTILE)] + " " * (i // len(HOSTILE)) for i in range(count)]
    entrants = selection.tables["entrants"].with_columns(name=pl.Series(names), source=pl.lit("=1+1"))
    skills = selection.tables["skills"].with_columns(pl.col("test").replace({"hot_lap": "=2+2"}))
    hostile = Selection(
        "=1+1",
        {**selection.tables, "entrants": entrants, "skills": skills},
        selection.results,
        {**selection.summary, "circuit": "=1+1", "versions": {"=1+1": "=1+1"}},
    )
    path = write_spreadsheet(hostile, tmp_path / "ranking.xlsx")
    book = openpyxl.load_workbook(path)
    formulas = [
        (sheet.title, cell.value)
        for sheet in book
        for row in sheet.iter_rows()
        for cell in row
        if cell.data_type == "f"
    ]
    assert len(formulas) == hostile.tables["battery"].height
    assert all(title == "Skills" and str(value).startswith("=SUM(") for title, value in formulas)
    assert {row["Entrant"] for row in _rows(path, "Pareto")} == set(names)
    assert all(cell.hyperlink is None for row in book["Pareto"].iter_rows() for cell in row)


def test_same_selection_same_bytes(selection: Selection, tmp_path: Path) -> None:
    first = write_spreadsheet(selection, tmp_path / "a.xlsx").read_bytes()
    assert first == write_spreadsheet(selection, tmp_path / "b.xlsx").read_bytes()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.xlsx", "b.xlsx"]


@pytest.mark.parametrize("entrants", [0, 1])
def test_small_selections(tmp_path: Path, entrants: int) -> None:
    chosen = build(np.random.default_rng(1), 1, 1, 1.0) if entrants else with_tables({})
    path = write_spreadsheet(chosen, tmp_path / "ranking.xlsx")
    book = openpyxl.load_workbook(path)
    assert book.sheetnames == SHEETS
    assert len([row for row in _rows(path, "Ranking") if row["Entrant"]]) == entrants


def test_rows_above_the_limit_are_counted(
    selection: Selection, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reports.spreadsheet, "ROW_LIMIT", 6)
    early = selection.results.with_columns(stage=pl.lit("pareto"))
    both = Selection(
        selection.title, selection.tables, pl.concat([early, selection.results]), selection.summary
    )
    path = write_spreadsheet(both, tmp_path / "ranking.xlsx")
    races = _rows(path, "Races")
    assert [row["Stage"] for row in races] == ["tournament"] * 6
    run = {row["Fact"]: row["Value"] for row in _rows(path, "Run")}
    assert run["Rows left out of Races"] == both.results.height - 6
