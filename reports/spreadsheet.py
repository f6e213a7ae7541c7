"""The report as a spreadsheet: every number of the selection, with filters."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import polars as pl
import xlsxwriter
from xlsxwriter.exceptions import FileCreateError

from nathlon.reports._committee_sheet import write_committee_sheet
from nathlon.reports._sheets import (
    BLUES,
    DIVERGING,
    ENTRANT,
    ORANGES,
    ORIGIN,
    RANK,
    TEXT,
    Column,
    add_table,
    write_cell,
    write_sheet,
)
from nathlon.reports._skill_sheets import write_skills, write_weighted
from nathlon.results.selection import Selection
from nathlon.results.summary import Summary
from nathlon.results.words import SHARE, STAGES, measure_head, stage_called
from nathlon.sim.whole_file import whole_file

CREATED = datetime(2020, 1, 1)  # a constant, so that the same selection gives the same bytes
ROW_LIMIT = 10_000  # rows of a sheet; all rows are in the tables beside it, and above this it opens slowly
RECORD = (
    Column("mean", "Mean [1/race]", "0.00", scale=BLUES),
    Column("mean_low", "Mean low [1/race]", "0.00"),
    Column("mean_high", "Mean high [1/race]", "0.00"),
    Column("won", "Won", "0%"),
    Column("drawn", "Drawn", "0%"),
    Column("lost", "Lost", "0%"),
)
"""Of formats other than 4v4."""
ACTION = (
    Column("action_ms", "Action, median [ms]", "0.000", scale=ORANGES),
    Column("action_p99_ms", "Action, 99th percentile [ms]", "0.000", scale=ORANGES),
    Column("model_mb", "Model [MB]", "0.00", scale=ORANGES),
)
"""Where the finalists were timed."""
RANKING = (
    RANK,
    *ENTRANT,
    *RECORD,
    Column("points_per_race", "Points [1/race]", "0.00", scale=BLUES),
    Column("points_low", "Points low [1/race]", "0.00"),
    Column("points_high", "Points high [1/race]", "0.00"),
    Column("contacts_per_km", "Contacts [1/km]", "0.000", scale=ORANGES),
    Column("contacts_low", "Contacts low [1/km]", "0.000"),
    Column("contacts_high", "Contacts high [1/km]", "0.000"),
    Column("at_fault_per_km", "At fault [1/km]", "0.000", scale=ORANGES),
    Column("at_fault_low", "At fault low [1/km]", "0.000"),
    Column("at_fault_high", "At fault high [1/km]", "0.000"),
    Column("barred", "Barred"),
    Column("pairs", "Units", "#,##0"),
    Column("races", "Races", "#,##0"),
    Column("faults", "Faults", "#,##0"),
    *ACTION,
)
MATCHUPS = (
    *ENTRANT,
    Column("opponent_name", "Opponent", width=28),
    Column("pairs", "Units", "#,##0"),
    Column("points_per_race", "Points [1/race]", "0.00"),
    Column("difference", "Difference [points/race]", "+0.00;-0.00;0.00", 15, DIVERGING),
    Column("difference_low", "Difference low [points/race]", "+0.00;-0.00;0.00", 15),
    Column("difference_high", "Difference high [points/race]", "+0.00;-0.00;0.00", 15),
    Column("contacts_per_km", "Contacts [1/km]", "0.000", scale=ORANGES),
)
STRATEGIES = (
    Column("name", "Policy", width=28),
    Column("strategy", "Strategy", width=18),
    Column("points", "Points [1/race]", "0.00", scale=BLUES),
    Column("points_low", "Points low [1/race]", "0.00"),
    Column("points_high", "Points high [1/race]", "0.00"),
    Column("effect", "Effect [points/race]", "+0.00;-0.00;0.00", 15, DIVERGING),
    Column("effect_low", "Effect low [points/race]", "+0.00;-0.00;0.00", 15),
    Column("effect_high", "Effect high [points/race]", "+0.00;-0.00;0.00", 15),
    Column("units", "Units", "#,##0"),
)
"""Of an event: both, and each with all of the others."""
ELSEWHERE = (Column("score", "Score", "0.00"), Column("measures", "Measures", width=30))
"""What only other worlds measure."""
RACES = (
    *ENTRANT,
    Column("stage", "Stage"),
    Column("test", "Test", width=18),
    Column("race", "Race", "0", 8),
    Column("seed", "Race seed", "0"),
    Column("mirrored", "Mirrored"),
    Column("car", "Car", "0", 8),
    Column("slot", "Starting place", "0"),
    Column("team", "Team", "0", 8),
    Column("place", "Place", "0", 8),
    Column("points", "Points", "0.##"),
    *ELSEWHERE,
    Column("laps", "Laps", "0", 8),
    Column("ending", "Ending", width=15),
    Column("race_time_s", "Race time [s]", "0.000"),
    Column("driven_s", "Driven [s]", "0.0"),
    Column("distance_m", "Distance [m]", "#,##0"),
    Column("best_lap_s", "Best lap [s]", "0.000"),
    Column("off_course_s", "Off course [s]", "0.0"),
    Column("wall_s", "Wall contact [s]", "0.0"),
    Column("contacts", "Contacts", "0"),
    Column("contacts_faster_behind", "Contacts from behind", "0"),
    Column("contacts_at_fault", "Contacts at fault", "0"),
    Column("penalties", "Penalties", "0"),
    Column("match", "Match", width=15),
)
MATCH_DIGITS = 12
"""Of a match's key on a sheet; commands know it by them."""


def write_spreadsheet(selection: Selection, path: Path) -> Path:
    """Write the workbook, whole or not at all, and return its path.

    Sheets: Committee, Ranking, Skills, Weighted, Matchups, Pareto, Races, Run, Files, and Strategies where
    policies are crossed with them. The first row of Skills has a weight for every test, which may be changed;
    Weighted is the order that follows. No text of the selection becomes a formula or a link. Races holds at
    most `ROW_LIMIT` rows, the last stages first; Run counts those left out.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        with whole_file(path) as partial:
            _write(selection, partial)
    except FileCreateError as error:
        # It wraps what the system said.
        raise OSError(*error.args[0].args) from None
    return path


def _write(selection: Selection, path: Path) -> None:
    plain_text = {"strings_to_formulas": False, "strings_to_urls": False, "strings_to_numbers": False}
    names = selection.tables["entrants"].select("entrant", "name")
    opponents = names.rename({"entrant": "opponent", "name": "opponent_name"})
    with xlsxwriter.Workbook(str(path), plain_text) as workbook:
        workbook.set_properties({"title": selection.title, "created": CREATED})
        write_committee_sheet(workbook, selection)
        ranking = selection.named("ranking").sort(["rank", "points_per_race"], descending=[False, True])
        write_sheet(workbook, "Ranking", _filled(selection, RANKING, ranking), ranking)
        skills = write_skills(workbook, selection)
        write_weighted(workbook, skills)
        matchups = selection.named("matchups").join(
            opponents, on="opponent", how="left", maintain_order="left"
        )
        write_sheet(workbook, "Matchups", _filled(selection, MATCHUPS, matchups), matchups)
        strategies = selection.tables["strategies"].rename({"policy": "name"})
        if not strategies.is_empty():
            write_sheet(
                workbook,
                "Strategies",
                STRATEGIES,
                strategies.with_columns(name=_all("name"), strategy=_all("strategy")),
            )
        _pareto(workbook, selection)
        races = selection.results.join(names, on="entrant", how="left", maintain_order="left").with_columns(
            name=pl.coalesce("name", "entrant"),  # a fixed opponent is no entrant
            match=pl.col("match").str.head(MATCH_DIGITS),
            car=pl.col("car") + 1,  # start numbers
        )
        latest = ["race", "tournament", "battery", "pareto"]
        races = races.sort(pl.col("stage").replace_strict(latest, range(4), default=4), maintain_order=True)
        shown = (
            races.head(ROW_LIMIT)
            .fill_nan(None)
            .with_columns(pl.col("stage").replace(STAGES), pl.col("test", "ending").str.replace_all("_", " "))
        )
        write_sheet(workbook, "Races", _filled(selection, RACES, races), shown)
        _run(workbook, selection, left_out=max(0, races.height - ROW_LIMIT))
        write_sheet(workbook, "Files", (*ENTRANT, *ORIGIN), selection.tables["entrants"])


def _all(column: str) -> pl.Expr:
    """What a row of STRATEGIES is about, where that is all of them too."""
    return pl.when(pl.col(column) == "").then(pl.lit("all")).otherwise(pl.col(column))


def _filled(selection: Selection, columns: tuple[Column, ...], frame: pl.DataFrame) -> tuple[Column, ...]:
    """The columns; in another world without those that it does not measure, and in its words."""
    known = {c.name for c in columns if frame.is_empty() or frame[c.name].is_not_null().any()}
    if selection.summary.circuit:
        sparse = (*RECORD, *ACTION)
        return tuple(c for c in columns if c not in ELSEWHERE and (c not in sparse or c.name in known))
    return tuple(
        replace(c, header=_in_words(c.header, selection.summary)) for c in columns if c.name in known
    )


def _in_words(header: str, summary: Summary) -> str:
    """A header in the words of a world that has no races."""
    known = {
        "Races": summary.episodes.capitalize(),
        "Car": "Seat",
        "Starting place": "Seat, from 1",
        "Car runs": "Runs of a seat",
        "Car runs ended by a policy's fault": "Runs of a seat ended by a policy's fault",
        "Void car runs": "Void runs of a seat",
        "Rows left out of Races": "Rows left out of the sheet Races",
        "Points [1/race]": f"Fitted points [1/{summary.episode}]",
    }
    if header in known:
        return known[header]
    for race, episode in (("races", summary.episodes), ("race", summary.episode)):
        header = header.replace(race, episode).replace(race.capitalize(), episode.capitalize())
    return header


def _pareto(workbook: Any, selection: Selection) -> None:
    """One row an entrant and one column an objective."""
    objectives = selection.tables["objectives"].fill_nan(None)
    measured = objectives.unique("objective", maintain_order=True)
    names = measured["objective"].to_list()
    wide = objectives.pivot("objective", index="entrant", values="value").rename(
        {name: f"objective {name}" for name in names}
    )
    columns = (
        *ENTRANT,
        *(_objective(*one) for one in measured.select("objective", "source", "unit").iter_rows()),
        Column("nondominated_probability", "Non-dominated in draws", "0.0%", 15, BLUES),
        Column("survives", "Survives"),
        Column("races", "Races", "#,##0"),
    )
    frame = (
        selection.named("pareto")
        .join(wide, on="entrant", how="left", maintain_order="left")
        .sort("survives", "nondominated_probability", descending=True, nulls_last=True, maintain_order=True)
    )
    write_sheet(workbook, "Pareto", _filled(selection, columns, frame), frame)


def _objective(name: str, source: str, unit: str) -> Column:
    """The column of an objective: what it is, and where it was measured."""
    where = "time trials" if source == "time_trial" else "filter's races"
    form = "0.00%" if name.endswith(SHARE) else "0.000"
    return Column(f"objective {name}", f"{measure_head(name, unit)} ({where})", form, 16, ORANGES)


def _run(workbook: Any, selection: Selection, left_out: int) -> None:
    summary = selection.summary
    facts: list[tuple[str, Any]] = [
        ("Title", selection.title),
        ("World", summary.world),
        ("Circuit", summary.circuit),
        ("Car", summary.car),
        ("Seed", summary.seed),
        ("Confidence of intervals", summary.confidence),
        ("Correlation within mirrored pairs", summary.pair_correlation),
        ("Car runs", summary.car_runs),
        ("Car runs ended by a policy's fault", summary.faults),
        ("Void car runs", summary.void),
        ("Rows left out of Races", left_out),
    ]
    for stage in summary.stages:
        name = stage_called(stage.name).capitalize()
        facts += [
            (f"{name}: entrants in", stage.entered),
            (f"{name}: entrants out", stage.left),
            (f"{name}: races", stage.races),
            (f"{name}: time [s]", stage.wall_s),
        ]
    if summary.action_times:
        facts.append(("Actions", summary.timed_on))
    facts += [(f"Version of {name}", version) for name, version in sorted(summary.versions.items())]
    look: dict[str, Any] = {"align": "left"}
    sheet = add_table(workbook, "Run", [("Fact", look), ("Value", look)], len(facts))
    sheet.fit_to_pages(1, 1)
    left, rounded = (workbook.add_format({**look, "num_format": form}) for form in (TEXT, "0.00"))
    wrapped = workbook.add_format({**look, "text_wrap": True})
    sheet.freeze_panes(1, 0)
    sheet.set_column(0, 0, 36)
    sheet.set_column(1, 1, 60)
    for row, (fact, value) in enumerate(facts, start=1):
        sheet.write_string(row, 0, fact if summary.circuit else _in_words(fact, summary))
        form = wrapped if isinstance(value, str) else rounded if isinstance(value, float) else left
        write_cell(sheet, row, 1, value, form)
