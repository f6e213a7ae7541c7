from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import openpyxl
import polars as pl
import pytest

import nathlon.reports.spreadsheet
from nathlon.arena.results import STRATEGIES
from nathlon.reports.spreadsheet import write_spreadsheet
from nathlon.reports.tables import write_tables
from nathlon.reports.verdict import verdict
from nathlon.results.selection import Selection
from tests.support.selections import TESTS, build, with_tables

SOFFICE = shutil.which("soffice")
SHEETS = ["Committee", "Ranking", "Skills", "Weighted", "Matchups", "Pareto", "Races", "Run", "Files"]
HOSTILE = ("=1+1", "+1", "-1", "@SUM(A1)", "=cmd|' /C calc'!A0", "{=1+1}", "https://example.org", "42")


def _rows(path: Path, sheet: str, formulas: bool = False) -> list[dict[str, object]]:
    values = openpyxl.load_workbook(path, data_only=not formulas)[sheet].iter_rows(values_only=True)
    if sheet == "Skills":
        next(values)  # the weights
    header = [str(name) for name in next(values)]
    return [dict(zip(header, row, strict=True)) for row in values]


@pytest.fixture
def selection() -> Selection:
    return build(np.random.default_rng(0), entrants=80, finalists=5)


def test_values_and_table_ranges(selection: Selection, tmp_path: Path) -> None:
    path = write_spreadsheet(selection, tmp_path / "report" / "ranking.xlsx")
    book = openpyxl.load_workbook(path)
    assert book.sheetnames == SHEETS
    heights = {
        "Ranking": selection.tables["ranking"].height,
        "Files": selection.tables["entrants"].height,
        "Skills": selection.tables["battery"].height,
        "Weighted": selection.tables["battery"].height,
        "Matchups": selection.tables["matchups"].height,
        "Pareto": selection.tables["pareto"].height,
        "Races": selection.results.height,
    }
    for name, height in heights.items():
        (table,) = book[name].tables.values()
        top = 2 if name == "Skills" else 1
        assert table.ref == f"A{top}:{book[name].dimensions.split(':')[1]}"
        assert book[name].max_row == height + top
        assert table.autoFilter is not None
        assert book[name].freeze_panes is not None
    # A cell is a float: seeds that it cannot hold are text.
    large = selection.results.with_columns(seed=pl.lit(2**62 + 1, pl.Int64))
    seeds = _rows(write_spreadsheet(replace(selection, results=large), tmp_path / "large.xlsx"), "Races")
    assert {row["Race seed"] for row in seeds} == {str(2**62 + 1)}
    ranking = selection.named("ranking").sort(["rank", "points_per_race"], descending=[False, True])
    read = _rows(path, "Ranking")
    assert [row["Entrant"] for row in read] == ranking["name"].to_list()
    assert [row["Points [1/race]"] for row in read] == pytest.approx(ranking["points_per_race"].to_list())
    assert [row["Contacts low [1/km]"] for row in read] == pytest.approx(ranking["contacts_low"].to_list())
    pareto = _rows(path, "Pareto")
    assert (
        sum(row["Lap, s (time trials)"] is None for row in pareto)
        == selection.tables["pareto"]["lap_s"].null_count()
        > 0
    )
    assert sum(row["Survives"] == "yes" for row in pareto) == selection.tables["pareto"]["survives"].sum()
    matchup = _rows(path, "Matchups")[0]
    first = selection.tables["matchups"].row(0, named=True)
    assert matchup["Difference [points/race]"] == pytest.approx(first["difference"])
    run = {row["Fact"]: row["Value"] for row in _rows(path, "Run")}
    assert run["Seed"] == 7
    assert run["Filter: entrants in"] == 80
    assert run["Version of torch"] == "2.9.1"


def test_sums_and_places_are_formulas_with_their_values(selection: Selection, tmp_path: Path) -> None:
    path = write_spreadsheet(selection, tmp_path / "ranking.xlsx")
    expected = selection.named("battery").sort("points", descending=True).select("name", "points").rows()
    skills = _rows(path, "Skills")
    for column in ("Sum [points]", "Weighted sum [points]"):
        assert [(row["Entrant"], row[column]) for row in skills] == [
            (name, pytest.approx(points)) for name, points in expected
        ]
    assert [row["Weighted place"] for row in skills] == list(range(1, len(expected) + 1))
    assert [row["Entrant"] for row in _rows(path, "Weighted")] == [name for name, _ in expected]
    first = _rows(path, "Skills", formulas=True)[0]
    assert first["Sum [points]"] == "=SUM(B3:G3)"
    assert first["Weighted sum [points]"] == "=SUMPRODUCT($B$1:$G$1,B3:G3)"
    assert list(first)[1:7] == [f"{test.replace('_', ' ')} [points]" for test in TESTS]


@pytest.mark.parametrize("weights", [(1, 1, 1, 1, 1, 1), (0, 0, 3, 0.5, 0, 1)])
def test_weights_move_the_order(selection: Selection, tmp_path: Path, weights: tuple[float, ...]) -> None:
    """LibreOffice computes the order that follows from other weights as polars does."""
    if SOFFICE is None:
        pytest.skip("needs LibreOffice: apt-get install libreoffice-calc-nogui")
    path = write_spreadsheet(selection, tmp_path / "ranking.xlsx")
    book = openpyxl.load_workbook(path)
    for column, weight in enumerate(weights, start=2):
        book["Skills"].cell(1, column).value = weight
    (tmp_path / "in").mkdir()
    book.save(tmp_path / "in" / "ranking.xlsx")
    profile = f"-env:UserInstallation={(tmp_path / 'profile').as_uri()}"
    command = [SOFFICE, profile, "--headless", "--convert-to", "xlsx", "--outdir", "out", "in/ranking.xlsx"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=120)
    computed = _rows(tmp_path / "out" / "ranking.xlsx", "Weighted")
    factor = pl.DataFrame({"test": TESTS, "weight": [float(weight) for weight in weights]})
    expected = (
        selection.tables["skills"]
        .join(factor, on="test")
        .group_by("entrant")
        .agg(total=(pl.col("points") * pl.col("weight")).sum())
        .join(selection.tables["entrants"], on="entrant")
        .sort("total", descending=True)
    )
    assert [row["Entrant"] for row in computed] == expected["name"].to_list()
    assert [row["Weighted sum [points]"] for row in computed] == pytest.approx(expected["total"].to_list())
    before = [row["Entrant"] for row in _rows(path, "Weighted")]
    assert [row["Places gained by the weights"] for row in computed] == [
        before.index(name) - place for place, name in enumerate(expected["name"])
    ]


def test_hostile_names_are_text(selection: Selection, tmp_path: Path) -> None:
    count = selection.tables["entrants"].height
    names = [HOSTILE[i % len(HOSTILE)] + " " * (i // len(HOSTILE)) for i in range(count)]
    entrants = selection.tables["entrants"].with_columns(name=pl.Series(names), source=pl.lit("=1+1"))
    skills = selection.tables["skills"].with_columns(pl.col("test").replace({"hot_lap": "=2+2"}))
    hostile = replace(
        selection,
        title="=1+1",
        tables={**selection.tables, "entrants": entrants, "skills": skills},
        summary=selection.summary.model_copy(update={"circuit": "=1+1", "versions": {"=1+1": "=1+1"}}),
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
    assert len(formulas) == 6 * hostile.tables["battery"].height
    assert {(title, str(value).partition("(")[0]) for title, value in formulas} == {
        ("Skills", "=SUM"),
        ("Skills", "=SUMPRODUCT"),
        ("Skills", "=RANK"),
        ("Weighted", "=INDEX"),
        ("Weighted", "=MATCH"),
    }
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
    monkeypatch.setattr(nathlon.reports.spreadsheet, "ROW_LIMIT", 6)
    early = selection.results.with_columns(stage=pl.lit("pareto"))
    both = replace(selection, results=pl.concat([early, selection.results]))
    path = write_spreadsheet(both, tmp_path / "ranking.xlsx")
    races = _rows(path, "Races")
    assert [row["Stage"] for row in races] == ["round robin"] * 6
    assert [row["Car"] for row in races] == (selection.results["car"].head(6) + 1).to_list(), "start numbers"
    run = {row["Fact"]: row["Value"] for row in _rows(path, "Run")}
    assert run["Rows left out of Races"] == both.results.height - 6


def test_tables_are_written_for_other_programs(selection: Selection, tmp_path: Path) -> None:
    write_tables(selection, tmp_path)
    expected = {**selection.tables, "results": selection.results}
    assert {path.name for path in tmp_path.iterdir()} == {
        f"{name}.{kind}" for name in expected for kind in ("csv", "parquet")
    }
    for name, table in expected.items():
        assert pl.read_parquet(tmp_path / f"{name}.parquet").equals(table)
        text = pl.read_csv(tmp_path / f"{name}.csv", schema=table.schema)
        assert text.equals(table)


def test_a_rank_stays_a_number_and_shows_how_far_it_may_be(selection: Selection, tmp_path: Path) -> None:
    sheet = openpyxl.load_workbook(write_spreadsheet(selection, tmp_path / "ranking.xlsx"))["Ranking"]
    ranks = selection.named("ranking").sort("rank")
    cells = [row[0] for row in sheet.iter_rows(min_row=2)]
    assert [cell.value for cell in cells] == ranks["rank"].to_list()
    forms = [
        "0" if best == worst else f'0" to {worst}"'
        for best, worst in ranks.select("rank", "worst_rank").rows()
    ]
    assert sorted(cell.number_format for cell in cells) == sorted(forms)
    assert any("to" in form for form in forms)


def test_a_committee_finds_the_verdict_and_the_finalists_on_the_first_sheet(
    selection: Selection, tmp_path: Path
) -> None:
    book = openpyxl.load_workbook(write_spreadsheet(selection, tmp_path / "ranking.xlsx"))
    sheet, told = book.worksheets[0], verdict(selection)
    texts = [sheet.cell(row, 1).value for row in range(1, 2 + len(told.sentences))]
    assert texts == [told.headline, *told.sentences]
    [table] = sheet.tables.values()
    heads, *rows = [[cell.value for cell in row] for row in sheet[table.ref]]
    first = (
        selection.named("ranking")
        .sort(["rank", "points_per_race"], descending=[False, True])
        .row(0, named=True)
    )
    own = dict(zip(heads, rows[0], strict=True))
    assert (own["Entrant"], own["Committee"]) == (first["name"], "sent")
    assert own["Points, interval"] == f"{first['points_low']:.1f} to {first['points_high']:.1f}"
    assert own["Contacts, interval"] == f"{first['contacts_low']:.2f} to {first['contacts_high']:.2f}"
    assert len(rows) == selection.tables["ranking"].height


def test_texts_stand_apart_from_numbers_and_heads_above_them(selection: Selection, tmp_path: Path) -> None:
    book = openpyxl.load_workbook(write_spreadsheet(selection, tmp_path / "ranking.xlsx"))
    for sheet in (one for one in book if one.title != "Run"):
        [table] = sheet.tables.values()
        heads, first, *_ = sheet[table.ref]
        for head, cell in zip(heads, first, strict=True):
            assert head.alignment.horizontal == cell.alignment.horizontal, (sheet.title, head.value)
            assert (cell.alignment.horizontal, cell.alignment.indent) in (("right", 0), ("left", 1))
            assert not isinstance(cell.value, bool), (sheet.title, head.value)
    barred = [row["Barred"] for row in _rows(tmp_path / "ranking.xlsx", "Ranking")]
    expected = selection.named("ranking").sort(["rank", "points_per_race"], descending=[False, True])[
        "barred"
    ]
    assert barred == ["yes" if one else "no" for one in expected]


def test_the_facts_of_a_run_are_printed_whole_on_one_page(selection: Selection, tmp_path: Path) -> None:
    summary = selection.summary.model_copy(update={"pair_correlation": -0.043962})
    path = write_spreadsheet(replace(selection, summary=summary), tmp_path / "ranking.xlsx")
    sheet = openpyxl.load_workbook(path)["Run"]
    assert sheet.page_setup.fitToHeight in (1, None), "one, which needs no saying"
    cells = {fact.value: value for fact, value in sheet.iter_rows(min_row=2, max_col=2)}
    assert cells["Title"].alignment.wrap_text
    assert cells["Correlation within mirrored pairs"].number_format == "0.00"


def test_digests_and_paths_are_on_the_last_sheet_alone(selection: Selection, tmp_path: Path) -> None:
    book = openpyxl.load_workbook(write_spreadsheet(selection, tmp_path / "ranking.xlsx"))
    cards = selection.tables["entrants"]
    found = {
        sheet.title
        for sheet in book
        for row in sheet.iter_rows(values_only=True)
        for cell in row
        if cell in {*cards["entrant"], *cards["source"]}
    }
    assert found == {"Files"}


def test_a_printed_workbook_has_few_pages(selection: Selection, tmp_path: Path) -> None:
    if SOFFICE is None:
        pytest.skip("needs LibreOffice: apt-get install libreoffice-calc-nogui")
    many = replace(selection, results=pl.concat([selection.results] * 8))
    write_spreadsheet(many, tmp_path / "ranking.xlsx")
    profile = f"-env:UserInstallation={(tmp_path / 'profile').as_uri()}"
    command = [SOFFICE, profile, "--headless", "--convert-to", "pdf", "ranking.xlsx"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=120)
    printed = (tmp_path / "ranking.pdf").read_bytes()
    assert len(SHEETS) <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 2 * len(SHEETS)


def test_an_event_has_a_sheet_of_policies_and_strategies(selection: Selection, tmp_path: Path) -> None:
    rows = [
        ("quick", "", None, 5.5, 4.5, 6.5, 0.0, -0.1, 0.1, 4),
        ("", "planner", None, 6.0, None, None, 0.5, None, None, 4),
        ("quick", "planner", "a", 6.0, 5.0, 7.0, 0.0, 0.0, 0.0, 4),
    ]
    table = pl.DataFrame(rows, schema=STRATEGIES, orient="row")
    event = replace(selection, tables={**selection.tables, "strategies": table})
    read = _rows(write_spreadsheet(event, tmp_path / "ranking.xlsx"), "Strategies")
    assert [(row["Policy"], row["Strategy"]) for row in read] == [
        ("quick", "all"),
        ("all", "planner"),
        ("quick", "planner"),
    ]
    assert read[1]["Effect [points/race]"] == 0.5
