"""The first sheet: who is sent and why, and the finalists beside each other, on one printed page."""

from __future__ import annotations

from math import ceil
from typing import Any

import polars as pl

from nathlon.reports._sheets import ENTRANT, RANK, Column, write_sheet
from nathlon.reports.verdict import verdict
from nathlon.results.selection import Selection
from nathlon.results.words import percent

LETTERS = 1.1
"""Of a sentence in a line, for each digit that is as wide."""
LINE = 15.5
"""Height of a line, points."""
CONDUCT = (
    Column("contacts_per_km", "Contacts [1/km]", "0.00", 12),
    Column("contacts_interval", "Contacts, interval", width=16),
    Column("at_fault_per_km", "At fault [1/km]", "0.00", 12),
    Column("faults", "Faults", "#,##0", 8),
)


def write_committee_sheet(workbook: Any, selection: Selection) -> None:
    """The verdict in words, and below it the ranking with ties, intervals and contacts."""
    told = verdict(selection)
    texts = [told.headline, *told.sentences, _how_to_read(selection)]
    ranking = selection.named("ranking").sort(["rank", "points_per_race"], descending=[False, True])
    points = "mean" if ranking["mean"].is_not_null().any() else "points_per_race"
    ends = ("mean_low", "mean_high") if points == "mean" else ("points_low", "points_high")
    sent = [one.entrant for one in selection.summary.sent]
    frame = ranking.with_columns(
        points_interval=_interval(*ends, 1),
        contacts_interval=_interval("contacts_low", "contacts_high", 2),
        fate=pl.when(pl.col("entrant").is_in(sent))
        .then(pl.lit("sent"))
        .when("barred")
        .then(pl.lit("barred"))
        .otherwise(pl.lit("")),
    )
    columns = (
        RANK,
        *ENTRANT,
        Column("fate", "Committee", width=11),
        Column(points, f"Points [1/{selection.summary.episode}]", "0.0", 11),
        Column("points_interval", "Points, interval", width=16),
        *(CONDUCT if frame["contacts_per_km"].is_not_null().any() else CONDUCT[-1:]),
    )
    sheet = write_sheet(workbook, "Committee", columns, frame, top=len(texts) + 1)
    forms = [
        workbook.add_format({"text_wrap": True, "valign": "top", **look})
        for look in ({"bold": True, "font_size": 16}, {}, {"font_color": "#666666"})
    ]
    letters = LETTERS * sum(column.width for column in columns)
    for row, text in enumerate(texts):
        form = forms[0] if row == 0 else forms[-1] if row == len(texts) - 1 else forms[1]
        sheet.merge_range(row, 0, row, len(columns) - 1, None)
        sheet.write_string(row, 0, text, form)
        sheet.set_row(row, 26 if row == 0 else LINE * ceil(len(text) / letters))
    sheet.fit_to_pages(1, 1)


def _how_to_read(selection: Selection) -> str:
    confidence = percent(selection.summary.confidence)
    return (
        "Rank: from 1 + the number of entrants proven better to the last place before those proven worse. "
        f"Intervals: {confidence}, of one entrant. All figures are of the round robin. Files: last sheet."
    )


def _interval(low: str, high: str, digits: int) -> pl.Expr:
    """Both ends of an interval as a text; null where there is none."""
    ends = [pl.col(end).map_elements(lambda v: f"{v:.{digits}f}", pl.String) for end in (low, high)]
    return pl.concat_str([ends[0], pl.lit(" to "), ends[1]])
