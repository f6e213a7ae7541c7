"""The lap chart of a race: a row whenever a car has completed a lap."""

from __future__ import annotations

from typing import Any

import numpy as np
import polars as pl

from nathlon.sim.car import compound_ratio, load_compounds
from nathlon.sim.world import World

LAP_CHART = pl.Schema(
    {
        "car": pl.Int64,  # index in the race
        "lap": pl.Int64,  # that was completed, from 1
        "time_s": pl.Float64,  # since the start, at the line
        "lap_s": pl.Float64,  # null where it did not begin at the line
        "stops": pl.Int64,  # since the start
        "compound": pl.String,  # of the tyres on the car at the line
        "wear": pl.Float64,  # of the most worn of them, 1 is worn out
        "fuel_kg": pl.Float64,
        "contacts": pl.Int64,  # since the start
        "penalties": pl.Int64,  # likewise
    }
)


class LapChart:
    """Watches the first race of a world; an observer of its ticks."""

    def __init__(self) -> None:
        self._laps: Any = None
        self._compounds: list[dict[float, str]] = []
        self._rows: list[dict[str, Any]] = []

    def __call__(self, world: World) -> None:
        """Note which cars have completed a lap since the last call."""
        cars = world.state[0]
        if self._laps is None:
            self._laps = cars["laps"].copy()
            bases = [world.first_compound(model) for model in world.models]
            self._compounds = [
                {compound_ratio(base, name)[0]: name for name in load_compounds()} for base in bases
            ]
        for car in np.flatnonzero(cars["laps"] > self._laps):
            self._rows.append(self._row(int(car), cars[car]))
        np.copyto(self._laps, cars["laps"])

    def _row(self, car: int, state: Any) -> dict[str, Any]:
        lap_s = float(state["last_lap_s"])
        return {
            "car": car,
            "lap": int(state["laps"]),
            "time_s": float(state["line_s"][0]),
            "lap_s": None if np.isnan(lap_s) else lap_s,
            "stops": int(state["stops"]),
            "compound": self._compounds[state["model"]][float(state["tyre_grip"])],
            "wear": float(state["wear"].max()),
            "fuel_kg": float(state["fuel"]),
            "contacts": int(state["contacts"]),
            "penalties": int(state["penalties"]),
        }

    @property
    def frame(self) -> pl.DataFrame:
        """What was noted, LAP_CHART."""
        return pl.DataFrame(self._rows, schema=LAP_CHART)


def running_order(laps: pl.DataFrame) -> pl.DataFrame:
    """Places of all cars whenever the leader completes a lap: `lap` of the leader, `car`, `place`.

    Args:
        laps: LAP_CHART.
    """
    ends = laps.group_by("lap").agg(pl.col("time_s").min().alias("now_s")).sort("lap")
    by_car = {car: rows.sort("lap") for (car,), rows in laps.group_by("car", maintain_order=True)}
    rows = []
    for lap, now_s in ends.iter_rows():
        done = []
        for car, driven in by_car.items():
            times = driven["time_s"].to_numpy()
            count = int(np.searchsorted(times, now_s, side="right"))
            done.append((-count, times[count - 1] if count else np.inf, car))
        rows += [(lap, car, place) for place, (_, _, car) in enumerate(sorted(done), 1)]
    return pl.DataFrame(
        rows, schema={"lap": pl.Int64, "car": pl.Int64, "place": pl.Int64}, orient="row"
    ).sort("car", "lap")


def stints(laps: pl.DataFrame) -> pl.DataFrame:
    """Stints: `car`, `stint` from 1, `compound`, `first` and `last` lap, `best_s` and `mean_s` of its laps.

    A lap belongs to the stint in which it ended.

    Args:
        laps: LAP_CHART.
    """
    return (
        laps.group_by("car", pl.col("stops").alias("stint") + 1)
        .agg(
            compound=pl.col("compound").last(),
            first=pl.col("lap").min(),
            last=pl.col("lap").max(),
            best_s=pl.col("lap_s").min(),
            mean_s=pl.col("lap_s").mean(),
        )
        .sort("car", "stint")
    )
