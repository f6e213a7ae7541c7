"""What the tests of the store put into it."""

from __future__ import annotations

import numpy as np
import polars as pl

from nathlon.arena.results import TABLES
from tests.support.race_results import rows


def match_of(key: str, stage: str = "pareto", races: int = 2) -> pl.DataFrame:
    """RESULTS of some races of three cars, one of which has no lap."""
    race, car = (index.ravel() for index in np.indices((races, 3)))
    columns = {"match": key, "stage": stage, "race": race, "car": car, "distance_m": 1000 / (1 + race + car)}
    return rows(columns, races * 3).with_columns(
        best_lap_s=pl.when(pl.col("car") == 1).then(None).otherwise("best_lap_s")
    )


def filled(name: str) -> pl.DataFrame:
    """Two rows of a stage table, the second all null."""
    samples = {pl.String: "ä, \"b\"\n'c'", pl.Int64: -(2**62), pl.Float64: 0.1 + 0.2, pl.Boolean: True}
    return pl.DataFrame(
        {column: [samples[type(dtype)], None] for column, dtype in TABLES[name].items()}, schema=TABLES[name]
    )
