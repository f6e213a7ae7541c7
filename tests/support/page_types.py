"""Writes what the report's scripts are given as types of TypeScript, by which the linter checks them."""

from __future__ import annotations

import polars as pl

from nathlon.arena.results import RECORDS, RESULTS, TABLES
from nathlon.reports.payload import CAR, NOT_DRAWN

SHOWN = {name: schema for name, schema in TABLES.items() if name not in NOT_DRAWN}
SHOWN |= {"ranking": pl.Schema({**TABLES["ranking"], **RECORDS})}
CARS = {"entrant": RESULTS["entrant"], "slot": RESULTS["slot"]} | {name: RESULTS[name] for name in CAR}
NUMBERED = ("entrant", "opponent", "ending")
"""Columns of strings that the page has as numbers."""


def columns(schema: pl.Schema | dict[str, pl.DataType]) -> str:
    """Its columns as a type. What may be null is not told: a schema does not know."""
    types = {name: "string" if kind == pl.String else "number" for name, kind in schema.items()}
    types |= {name: "number" for name in NUMBERED if name in types}
    return f"{{ {'; '.join(f'{name}: {kind}[]' for name, kind in types.items())} }}"


def page_types() -> str:
    """The text of the file of types."""
    tables = "\n".join(f"  {name}: {columns(schema)};" for name, schema in SHOWN.items())
    cards = columns(TABLES["entrants"]).replace("entrant: number", "entrant: string")
    return (
        f"export interface Tables {{\n{tables}\n}}\nexport type Cars = {columns(CARS)};\n"
        f"export type Cards = {cards};\n"
    )


if __name__ == "__main__":
    print(page_types(), end="")
