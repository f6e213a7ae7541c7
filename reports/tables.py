"""All tables of a selection as files for other programs."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import polars as pl

from nathlon.results.selection import Selection
from nathlon.sim.whole_file import write_whole

FORMULA = r"^[=+\-@\t\r']"
"""How a text begins that spreadsheets may take for a formula, or that has the mark of one that does."""


def write_tables(selection: Selection, folder: Path) -> None:
    """Write each table and `results` into `folder` as CSV and as Parquet, every file whole or not at all.

    Schemas are those of `nathlon.arena.results`; times are in s, ways in m.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in {**selection.tables, "results": selection.results}.items():
        _replace(folder / f"{name}.csv", as_texts(table).write_csv)
        _replace(folder / f"{name}.parquet", table.write_parquet)


def as_texts(table: pl.DataFrame) -> pl.DataFrame:
    """The table for a CSV file: texts that begin as FORMULA says have an apostrophe before them.

    To take one apostrophe from texts that begin with it gives the table back.
    """
    text = pl.col(pl.String)
    return table.with_columns(
        pl.when(text.str.contains(FORMULA)).then("'" + text).otherwise(text).name.keep()
    )


def _replace(path: Path, write: Callable[[BytesIO], pl.DataFrame | None]) -> None:
    content = BytesIO()
    write(content)
    write_whole(path, content.getvalue())
