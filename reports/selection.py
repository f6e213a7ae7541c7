"""Everything that a report shows of one selection."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import polars as pl


@dataclass(frozen=True)
class Selection:
    """The tables of one selection with the facts of its run.

    `tables` has the keys and schemas of `arena.results.TABLES`, `results` that of
    `arena.results.RESULTS`. `summary` holds `stages` (each with `name`, `in`, `out`, `races`, `wall_s`),
    `seed`, `circuit`, `car`, `versions`, `pair_correlation` (or None), `confidence` (0.95), `faults`
    (car runs ended by a policy's fault), and `replay` and `recording`: paths of the deciding race's
    .rrd and .mcap relative to the report's folder (or None).
    """

    title: str
    tables: Mapping[str, pl.DataFrame]
    results: pl.DataFrame
    summary: Mapping[str, Any]

    def named(self, table: str) -> pl.DataFrame:
        """A stage table with each entrant's card (`name`, `step`, ...) beside it; NaN becomes null."""
        return (
            self.tables[table]
            .join(self.tables["entrants"], on="entrant", how="left", maintain_order="left")
            .fill_nan(None)
        )
