"""Who is where: results and laps with names, stints, and the table of a season."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import polars as pl

from nathlon.arena.lap_chart import stints
from nathlon.lab.events.race_folder import RaceDriven


def with_names(driven: RaceDriven, names: Sequence[str]) -> tuple[pl.DataFrame, pl.DataFrame]:
    """RESULTS with `name` and `stops`, by place, and LAP_CHART with `name`.

    Cars that an entrant has besides its first are told apart by their place on the grid.

    Args:
        driven: the race.
        names: of its entrants, who fill the grid in turn.
    """
    count = len(names)
    cars = sorted(driven.results["car"])
    called = {car: names[car % count] + (f" #{car + 1}" if len(cars) > count else "") for car in cars}
    name = pl.col("car").replace_strict(called, return_dtype=pl.String).alias("name")
    stops = driven.laps.group_by("car").agg(pl.col("stops").max())
    results = driven.results.join(stops, "car", "left").with_columns(pl.col("stops").fill_null(0))
    return results.select(name, pl.all()).sort("place"), driven.laps.select(name, pl.all())


def lap_times(laps: pl.DataFrame) -> pl.DataFrame:
    """Stints by `name`: of `nathlon.arena.lap_chart.stints`, in the order of the grid."""
    named = laps.select("car", "name").unique()
    return stints(laps).join(named, "car").select("name", pl.exclude("car", "name")).sort("name", "stint")


def season_table(results: Mapping[str, pl.DataFrame]) -> pl.DataFrame:
    """`place`, `name`, `points`, `wins`, and the points of each race by its name.

    Of equal points, more wins come first, then more second places, and so on.

    Args:
        results: of each race by its name, RESULTS with `name`.
    """
    races = list(results)
    names = results[races[0]].sort("slot")["name"].to_list()
    points = {race: dict(frame.select("name", "points").iter_rows()) for race, frame in results.items()}
    places = {name: [frame.filter(name=name)["place"][0] for frame in results.values()] for name in names}

    def merit(name: str) -> tuple[float, ...]:
        total = sum(points[race][name] for race in races)
        return -total, *(-places[name].count(place) for place in range(1, len(names) + 1))

    rows = [
        {
            "name": name,
            "points": sum(points[race][name] for race in races),
            "wins": places[name].count(1),
            **{race: points[race][name] for race in races},
        }
        for name in sorted(names, key=merit)
    ]
    return pl.DataFrame(rows).with_row_index("place", 1).with_columns(pl.col("place").cast(pl.Int64))
