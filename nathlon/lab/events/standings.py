"""Who is where: results and laps with names, stints, and the table of a season."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import polars as pl

from nathlon.arena.classification import PLACE_POINTS
from nathlon.arena.lap_chart import stints
from nathlon.lab.events.race_folder import RaceDriven

POINTS = {place: float(points) for place, points in enumerate(PLACE_POINTS, 1)}


class Started(NamedTuple):
    """A car on the grid: whose, and of which class."""

    name: str
    car_class: str


def with_names(driven: RaceDriven, grid: Sequence[Started]) -> tuple[pl.DataFrame, pl.DataFrame]:
    """RESULTS with `name`, `class`, `class_place`, `stops`, by place, and LAP_CHART with `name`, `class`.

    Where cars are of several classes, points are those of the place in the class. Several cars of an entrant
    are told apart by their place on the grid.

    Args:
        driven: the race.
        grid: its cars from pole.
    """
    several = len({car.name for car in grid}) < len(grid)
    facts = pl.DataFrame(
        [
            (index, car.name + (f" #{index + 1}" if several else ""), car.car_class)
            for index, car in enumerate(grid)
        ],
        {"car": pl.Int64, "name": pl.String, "class": pl.String},
        orient="row",
    )
    stops = driven.laps.group_by("car").agg(pl.col("stops").max())
    class_place = pl.col("place").rank("ordinal").over("class").cast(pl.Int64)
    results = (
        driven.results.join(facts, "car")
        .join(stops, "car", "left")
        .with_columns(pl.col("stops").fill_null(0), class_place=class_place)
        .sort("place")
    )
    if results["class"].n_unique() > 1:
        results = results.with_columns(points=pl.col("class_place").replace_strict(POINTS, default=0.0))
    laps = driven.laps.join(facts, "car", maintain_order="left")
    facts_first = pl.col("name", "class"), pl.exclude("name", "class")
    return results.select(facts_first), laps.select(facts_first)


def class_leaders(results: pl.DataFrame) -> dict[str, str]:
    """The name of the first of each class, by the classes, which come in the order of their first.

    Args:
        results: RESULTS as of `with_names`.
    """
    return dict(results.filter(class_place=1).sort("place").select("class", "name").iter_rows())


def lap_times(laps: pl.DataFrame) -> pl.DataFrame:
    """Stints by `name` and `class`: of `nathlon.arena.lap_chart.stints`, in the order of the grid."""
    named = laps.select("car", "name", "class").unique()
    found = stints(laps).join(named, "car").sort("car", "stint")
    return found.select("name", "class", pl.exclude("car", "name", "class"))


def season_table(results: Mapping[str, pl.DataFrame]) -> pl.DataFrame:
    """`class`, `place`, `name`, `points`, `wins`, and the points of each race by its name.

    Each class has places, and wins, of its own. Of equal points, more wins come first, then more second
    places, and so on.

    Args:
        results: of each race by its name, RESULTS as of `with_names`.
    """
    races = list(results)
    first = results[races[0]]
    names, classes = first.sort("slot")["name"].to_list(), dict(first.select("name", "class").iter_rows())
    order = list(class_leaders(first))
    points = {race: dict(frame.select("name", "points").iter_rows()) for race, frame in results.items()}
    places = {
        name: [frame.filter(name=name)["class_place"][0] for frame in results.values()] for name in names
    }

    def merit(name: str) -> tuple[float, ...]:
        total = sum(points[race][name] for race in races)
        return -total, *(-places[name].count(place) for place in range(1, len(names) + 1))

    rows = [
        {
            "class": classes[name],
            "name": name,
            "points": sum(points[race][name] for race in races),
            "wins": places[name].count(1),
            **{race: points[race][name] for race in races},
        }
        for name in sorted(names, key=lambda name: (order.index(classes[name]), merit(name)))
    ]
    place = pl.int_range(1, pl.len() + 1, dtype=pl.Int64).over("class").alias("place")
    return pl.DataFrame(rows).select("class", place, pl.exclude("class"))
