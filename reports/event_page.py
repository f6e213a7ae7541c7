"""The page of an event: results, laps and stints of its races."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import polars as pl

from nathlon.reports.event_figure import event_picture
from nathlon.reports.self_contained import render_page, template_text, write_page_file


class Chapter(NamedTuple):
    """A part of the page: a table, a picture, or both.

    Attributes:
        title: its heading.
        heads, rows: of its table; none without one.
        names: heads of columns that hold no numbers.
        picture: PNG in base64; empty without one.
        link: of a page that tells more; empty without one.
    """

    title: str
    heads: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    names: frozenset[str] = frozenset()
    picture: str = ""
    link: str = ""


TEXTS = frozenset({"Entrant", "Class", "Compound", "Ending", "Plan"})
"""Heads of columns that hold no numbers."""


def table_chapter(title: str, rows: Sequence[Sequence[str]], heads: Sequence[str]) -> Chapter:
    """A chapter with a table of cells in words, without columns that are empty."""
    said = [number for number in range(len(heads)) if not rows or any(row[number] for row in rows)]
    heads, *rows = ([line[number] for number in said] for line in (heads, *rows))
    return Chapter(title, heads, rows, TEXTS)


def lap_chapter(laps: pl.DataFrame, title: str) -> Chapter:
    """A chapter with the figure of a race, see `event_picture`; words alone if nobody came round."""
    if laps.is_empty():
        return Chapter(f"{title}: nobody has completed one")
    return Chapter(title, picture=base64.b64encode(event_picture(laps)).decode())


def write_event_page(folder: Path, headline: str, event: str, chapters: Sequence[Chapter]) -> Path:
    """Write `folder`/index.html, whole or not at all, and return its path.

    Args:
        folder: for the page.
        headline: what came of it.
        event: what it was.
        chapters: in their order.
    """
    page = render_page(
        "event.html",
        template_text("scroll.css", "gate.css", "recipes.css"),
        headline=headline,
        event=event,
        chapters=chapters,
    )
    return write_page_file(page, folder / "index.html")
