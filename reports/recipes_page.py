"""The page of recipes."""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from nathlon.reports.recipes_figure import recipes_picture
from nathlon.reports.self_contained import render_page, template_text, write_page_file
from nathlon.results.recipes import too_few
from nathlon.results.words import percent
from nathlon.sim.whole_file import write_whole

FEW = 5
"""Runs below which little is known of how they vary (Agarwal et al., 2021)."""
CELLS = (
    ("points", "Points a race", "{:+.1f}".format),
    ("iqm", "IQM", "{:+.1f}".format),
    ("gap", "Shortfall", "{:.1f}".format),
    ("better", "Better", percent),
    ("at_fault_per_km", "At fault / km", "{:.2f}".format),
)
"""What the tables show of RECIPES: column, heading and how a figure is written."""


def cells(row: dict[str, Any]) -> list[str]:
    """The figures of a row of RECIPES with their intervals, in the order of `CELLS`."""
    return [_interval(row, name, written) for name, _, written in CELLS]


def headline(recipes: pl.DataFrame) -> str:
    """What RECIPES come to: which are surely better or worse than the first, and which cannot be judged."""
    first, *others = recipes.to_dicts()
    better = [row["recipe"] for row in others if (row["better_low"] or 0.0) > 0.5]
    worse = [row["recipe"] for row in others if row["better_high"] is not None and row["better_high"] < 0.5]
    lost = [row["recipe"] for row in (first, *others) if not row["runs"]]
    if not others and not lost:
        return f"{first['recipe']}: {_interval(first, *CELLS[0][::2])} points a race"
    told = []
    if better:
        told.append(f"better than {first['recipe']}: {', '.join(better)}")
    if worse:
        told.append(f"worse than {first['recipe']}: {', '.join(worse)}")
    if lost:
        told.append(f"could not be judged, as most of its pairs are void: {', '.join(lost)}")
    elif not told:
        told.append(f"no recipe is surely better or worse than {first['recipe']}")
    few = [
        row["recipe"] for row in others if row["runs"] and too_few(row["runs"], first["runs"], len(others))
    ]
    if few:
        told.append(f"too few runs to prove it: {', '.join(few)}")
    text = "; ".join(told)
    return text[0].upper() + text[1:]


def write_recipes_page(
    recipes: pl.DataFrame,
    scores: pl.DataFrame,
    place: str,
    references: Sequence[str],
    folder: Path,
    remarks: Sequence[str] = (),
) -> Path:
    """Write `folder`/index.html and `folder`/recipes.png, each whole or not at all.

    Args:
        recipes, scores: schemas RECIPES and SCORES.
        place: where they raced, in words.
        references: names of whom they raced.
        folder: for the page.
        remarks: sentences on what did not count.

    Returns:
        the page's path.
    """
    picture = recipes_picture(recipes, scores)
    write_whole(folder / "recipes.png", picture)
    page = render_recipes(recipes, picture, place, references, remarks)
    return write_page_file(page, folder / "index.html")


def render_recipes(
    recipes: pl.DataFrame,
    picture: bytes,
    place: str,
    references: Sequence[str],
    remarks: Sequence[str] = (),
) -> str:
    """The page's HTML, which needs no network and runs no script."""
    return render_page(
        "recipes.html",
        template_text("scroll.css", "gate.css", "recipes.css"),
        headline=headline(recipes),
        place=place,
        references=references,
        remarks=remarks,
        heads=[head for _, head, _ in CELLS],
        rows=[row | {"cells": cells(row)} for row in recipes.to_dicts()],
        few=bool((recipes["runs"] < FEW).any()),
        picture=base64.b64encode(picture).decode(),
    )


def _interval(row: dict[str, Any], name: str, written: Callable[[float], str]) -> str:
    value, low, high = (row[f"{name}{bound}"] for bound in ("", "_low", "_high"))
    if value is None:
        return ""
    text = written(value)
    return text if low is None else f"{text} ({written(low)} to {written(high)})"
