"""The report as one web page that needs no network."""

from __future__ import annotations

import base64
import hashlib
import math
import os
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import polars as pl
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from reports.selection import Selection
from reports.verdict import verdict

HERE = Path(__file__).parent
BAR_WIDTH = 160  # drawing units of an interval's bar, as in templates/macros.html
HEAT_LEVELS = 5  # shades on each side of zero, as in templates/page.css
ABSENT = "–"


def write_page(selection: Selection, folder: Path) -> Path:
    """Write `folder`/index.html, whole or not at all, and return its path."""
    html = render(selection)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "index.html"
    partial = folder / "index.html.partial"
    try:
        partial.write_text(html, encoding="utf-8")
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    return path


def render(selection: Selection) -> str:
    """The page's HTML. Its policy admits only the style and the scripts written here, by their hashes."""
    environment = Environment(
        loader=FileSystemLoader(HERE / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "argument": shlex.quote,
        "duration": duration,
        "key": key,
        "local": quote,
        "number": number,
        "percent": percent,
        "short": short,
        "signed": signed,
    }
    style = (HERE / "templates" / "page.css").read_text("utf-8")
    scripts = [_licensed("d3.min.js", "d3"), _licensed("plot.umd.min.js", "plot")]
    scripts.append((HERE / "templates" / "page.js").read_text("utf-8"))
    return environment.get_template("page.html").render(
        title=selection.title,
        summary=selection.summary,
        verdict=verdict(selection),
        leaderboard=_leaderboard(selection),
        matchups=_matchups(selection),
        skills=_skills(selection),
        pareto=_pareto(selection),
        policy=(
            f"default-src 'none'; style-src {_digest(style)}; "
            f"script-src {' '.join(map(_digest, scripts))}; "
            "img-src data:; base-uri 'none'; form-action 'none'"
        ),
        style=Markup(style),
        scripts=[Markup(script) for script in scripts],
    )


def number(value: float | None, digits: int = 0) -> str:
    """Grouped thousands, a true minus sign, a dash for what is absent."""
    return ABSENT if value is None else f"{value:,.{digits}f}".replace("-", "−")


def percent(share: float | None, digits: int = 0) -> str:
    """A share of one, times a hundred, as `number`."""
    return number(None if share is None else 100 * share, digits)


def key(value: object) -> object:
    """What a column sorts by: empty for what is absent."""
    return "" if value is None else value


def signed(value: float | None, digits: int = 1) -> str:
    """As `number`, with a plus sign where positive."""
    return ABSENT if value is None else f"{value:+,.{digits}f}".replace("-", "−")


def duration(seconds: float) -> str:
    """Seconds in the two largest units that fit."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    hours, minutes = divmod(minutes, 60)
    return f"{hours:,} h {minutes} min"


def short(entrant: str) -> str:
    """A checkpoint's digest cut to ten digits; a built-in driver's id as it is."""
    return entrant if ":" in entrant else entrant[:10]


def _licensed(file: str, package: str) -> str:
    vendor = HERE / "vendor"
    licence = (vendor / f"{package}.LICENSE").read_text("utf-8")
    return f"/*\n{licence}*/\n{(vendor / file).read_text('utf-8')}"


def _digest(text: str) -> str:
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    return f"'sha256-{digest}'"


def _ranked(table: pl.DataFrame, points: str) -> pl.DataFrame:
    """By rank, then points; `tied` if the rank is shared, `opens` on the first row of each rank."""
    return table.sort(
        ["rank", points, "name"], descending=[False, True, False], nulls_last=True
    ).with_columns(
        tied=pl.len().over("rank") > 1,
        opens=pl.col("rank").ne_missing(pl.col("rank").shift()),
    )


def _leaderboard(selection: Selection) -> dict[str, Any]:
    rows = _ranked(selection.named("ranking"), "points_per_race")
    points = _Scale(
        rows, ("points_per_race", "points_low", "points_high"), origin=rows["points_per_race"].mean()
    )
    contacts = _Scale(rows, ("contacts_per_km", "contacts_low", "contacts_high"), origin=0.0)
    return {
        "rows": [
            row
            | {
                "points_bar": points.bar(row["points_per_race"], row["points_low"], row["points_high"]),
                "contacts_bar": contacts.bar(
                    row["contacts_per_km"], row["contacts_low"], row["contacts_high"]
                ),
            }
            for row in rows.to_dicts()
        ],
        "reference": points(rows["points_low"].max()),
    }


class _Scale:
    """Maps values onto the width of a bar, so that all intervals of a column share one axis."""

    def __init__(self, rows: pl.DataFrame, columns: Sequence[str], origin: Any) -> None:
        values = [value for column in columns for value in rows[column].drop_nulls()]
        self.origin = 0.0 if origin is None else float(origin)
        self.low = min([*values, self.origin])
        self.span = max([*values, self.origin]) - self.low or 1.0

    def __call__(self, value: Any) -> float | None:
        margin = 3  # room for the whiskers' caps
        if value is None:
            return None
        return round(margin + (BAR_WIDTH - 2 * margin) * (float(value) - self.low) / self.span, 1)

    def bar(self, value: float | None, low: float | None, high: float | None) -> dict[str, Any]:
        """Where to draw the bar from the origin to the value, and the whiskers."""
        end, origin = self(value), self(self.origin)
        if end is None or origin is None:
            return {"shown": False}
        return {
            "shown": True,
            "x": min(origin, end),
            "width": round(abs(end - origin), 1),
            "origin": origin,
            "end": end,
            "low": self(low),
            "high": self(high),
        }


def _matchups(selection: Selection) -> dict[str, Any]:
    order = _ranked(selection.named("ranking"), "points_per_race").select("entrant", "name").rows()
    cells = {
        (row["entrant"], row["opponent"]): row
        for row in selection.tables["matchups"].fill_nan(None).drop_nulls("difference").to_dicts()
    }
    largest = max((abs(row["difference"]) for row in cells.values()), default=0.0)
    for row in cells.values():
        low, high = row["difference_low"], row["difference_high"]
        row["heat"] = _heat(row["difference"], largest)
        row["decided"] = low is not None and high is not None and (low > 0 or high < 0)
    return {
        "names": [name for _, name in order],
        "largest": largest,
        "rows": [
            (name, [cells.get((entrant, opponent)) for opponent, _ in order]) for entrant, name in order
        ],
        "any": bool(cells),
    }


def _heat(value: float, largest: float) -> str:
    """The class of a heat map's cell: h0 for zero, p1..p5 up to `largest`, n1..n5 down to its negative."""
    level = math.ceil(HEAT_LEVELS * abs(value) / largest) if largest > 0 else 0
    return "h0" if level == 0 else f"{'p' if value > 0 else 'n'}{level}"


def _skills(selection: Selection) -> dict[str, Any]:
    battery = _ranked(selection.named("battery"), "points")
    skills = selection.tables["skills"].fill_nan(None)
    lowest, largest = (float(str(bound or 0.0)) for bound in (skills["points"].min(), skills["points"].max()))
    scale = _Scale(battery, ("points", "points_low", "points_high"), origin=battery["points"].mean())
    cells = {
        (row["entrant"], row["test"]): row | {"heat": _heat(row["points"] - lowest, largest - lowest)}
        for row in skills.drop_nulls("points").to_dicts()
    }
    tests = skills["test"].unique(maintain_order=True).to_list()
    return {
        "tests": tests,
        "lowest": lowest,
        "largest": largest,
        "rows": [
            row
            | {
                "cells": [cells.get((row["entrant"], test)) for test in tests],
                "bar": scale.bar(row["points"], row["points_low"], row["points_high"]),
            }
            for row in battery.to_dicts()
        ],
        "reference": scale(battery["points_low"].max()),
    }


def _pareto(selection: Selection) -> dict[str, Any]:
    """The points to draw, survivors last so that they lie on top, and the counts of the notes."""
    finalists = selection.tables["ranking"].select("entrant", finalist_rank="rank")
    field = selection.named("pareto").join(finalists, on="entrant", how="left", maintain_order="left")
    drawn = field.drop_nulls(["lap_s", "off_course_share", "contacts_per_km"]).sort(
        "survives", maintain_order=True
    )
    survivors = field.filter("survives").sort(["nondominated_probability", "name"], descending=[True, False])
    return {
        "entrants": field.height,
        "survivors": survivors.to_dicts(),
        "without_lap": field["lap_s"].null_count(),
        "survivors_without_lap": survivors["lap_s"].null_count(),
        "drawn": drawn.height,
        "points": {
            "name": drawn["name"].to_list(),
            "lap": drawn["lap_s"].round(3).to_list(),
            "off": drawn["off_course_share"].round(5).to_list(),
            "contacts": drawn["contacts_per_km"].round(3).to_list(),
            "survives": drawn["survives"].to_list(),
            "rank": drawn["finalist_rank"].to_list(),
        },
    }
