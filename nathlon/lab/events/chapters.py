"""What the pages of events say: tables of races, of stints, of qualifying and of a season."""

from __future__ import annotations

from collections.abc import Sequence

import polars as pl

from nathlon.lab.events.standings import lap_times
from nathlon.reports.event_page import Chapter, table_chapter


def of_classes(results: pl.DataFrame) -> bool:
    """Whether there are several classes in results as of `nathlon.lab.events.standings`."""
    return results["class"].n_unique() > 1


def race_chapter(results: pl.DataFrame, title: str) -> Chapter:
    """The table of a race."""
    heads = (
        "Place",
        "Class",
        "In class",
        "Entrant",
        "Laps",
        "km",
        "Time",
        "Best lap",
        "Stops",
        "Contacts",
        "Pen.",
        "Ending",
        "Points",
    )
    several = of_classes(results)
    rows = [
        [
            str(row["place"]),
            *((row["class"], str(row["class_place"])) if several else ("", "")),
            *(row["name"], str(row["laps"]), f"{row['distance_m'] / 1000:.1f}"),
            *(seconds(row["race_time_s"]), seconds(row["best_lap_s"]), str(row["stops"])),
            *(str(row["contacts"]), str(row["penalties"])),
            *(row["ending"].replace("_", " "), _cell(row["points"])),
        ]
        for row in results.iter_rows(named=True)
    ]
    return table_chapter(title, rows, heads)


def stint_chapter(laps: pl.DataFrame) -> Chapter:
    """The stints of a race."""
    heads = ("Entrant", "Class", "Stint", "Compound", "Laps", "Best lap", "Mean lap")
    several = of_classes(laps)
    rows = [
        [
            *(row["name"], row["class"] if several else "", str(row["stint"]), row["compound"]),
            *(f"{row['first']} to {row['last']}", seconds(row["best_s"]), seconds(row["mean_s"])),
        ]
        for row in lap_times(laps).iter_rows(named=True)
    ]
    return table_chapter("Stints", rows, heads)


def qualifying_chapter(qualifying: pl.DataFrame) -> Chapter:
    """Qualifying, from pole: `name`, `class` and `lap_s`."""
    several = of_classes(qualifying)
    rows = [
        [str(place), row["class"] if several else "", row["name"], seconds(row["lap_s"]) or "no time"]
        for place, row in enumerate(qualifying.iter_rows(named=True), 1)
    ]
    return table_chapter("Qualifying", rows, ("Place", "Class", "Entrant", "Lap"))


def practice_chapter(practice: pl.DataFrame, results: pl.DataFrame) -> Chapter:
    """Practice: what the race of each entrant was expected to take and took, or why it has no plan."""
    came = dict(zip(results["name"], results["race_time_s"], strict=True))
    rows = [
        [
            row["name"],
            "from practice" if row["plan"] else f"none: {row['reason']}" if row["reason"] else "",
            seconds(row["expected_s"]),
            seconds(came[row["name"]]),
        ]
        for row in practice.iter_rows(named=True)
    ]
    return table_chapter("Practice", rows, ("Entrant", "Plan", "Expected", "Came"))


def season_chapter(table: pl.DataFrame, circuits: Sequence[str]) -> Chapter:
    """The table of a season with races on some circuits."""
    several = of_classes(table)
    rows = [[name if several else "", *(_cell(value) for value in row)] for name, *row in table.iter_rows()]
    return table_chapter("Table", rows, ("Class", "Place", "Entrant", "Points", "Wins", *circuits))


def seconds(value: float | None) -> str:
    """A time; nothing where there is none."""
    return "" if value is None else f"{value:,.3f}"


def _cell(value: object) -> str:
    if value is None:
        return ""
    return f"{value:g}" if isinstance(value, float) else str(value)
