"""From the final state of races to their rows of the results table."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from nathlon.arena.match import Match
from nathlon.arena.results import POLICY_FAULTS, RESULTS, VOID_ENDINGS
from nathlon.sim.state import CAR_STATE

PLACE_POINTS = (10, 8, 6, 5, 4, 3, 2, 1)
"""Of places 1 to 8; further places score nothing."""

BLANK = np.zeros((), CAR_STATE)
"""A car of a race that came to nothing."""
for _unset in ("best_lap_s", "finish_s"):
    BLANK[_unset] = np.nan


def classify(
    match: Match,
    cars: NDArray[np.void],
    endings: NDArray[np.str_],
    driven: NDArray[np.float64],
    stints: Mapping[tuple[int, int], str] = MappingProxyType({}),
) -> pl.DataFrame:
    """Results of a match, schema RESULTS.

    Finishers are placed by time, then the others by their progress on the road, then those that
    their own policy let down.

    Args:
        match: the match.
        cars: (races, cars) CAR_STATE at the end.
        endings: (races, cars) how each run ended.
        driven: (races, cars) time until then, s.
        stints: of the cars that have a strategist, as RESULTS has them, by race and car.
    """
    rows = [
        row
        for index in range(len(match.races))
        for row in _classify_race(match, index, cars[index], endings[index], driven[index], stints)
    ]
    return pl.DataFrame(rows, schema=RESULTS)


def void(match: Match, ending: str = "simulator_fault") -> pl.DataFrame:
    """Results (RESULTS) of a match that could not be run, with one of VOID_ENDINGS."""
    shape = (len(match.races), len(match.races[0].seats))
    return classify(match, np.full(shape, BLANK), np.full(shape, ending), np.zeros(shape))


def _classify_race(
    match: Match,
    index: int,
    cars: NDArray[np.void],
    endings: NDArray[np.str_],
    driven: NDArray[np.float64],
    stints: Mapping[tuple[int, int], str],
) -> list[dict[str, Any]]:
    distance = cars["progress"] - cars["start"]
    finished = endings == "finished"
    order = np.lexsort(
        (
            np.where(finished, 0.0, -cars["progress"]),
            np.where(finished, cars["finish_s"], 0.0),
            np.where(finished, 0, np.where(np.isin(endings, POLICY_FAULTS), 2, 1)),
        )
    )
    place = np.empty(len(cars), np.int64)
    place[order] = np.arange(1, len(cars) + 1)
    rows = []
    for car, state in enumerate(cars):
        rows.append(
            {
                **match.seat_facts(index, car),
                "place": int(place[car]),
                "points": float(PLACE_POINTS[place[car] - 1]) if place[car] <= len(PLACE_POINTS) else 0.0,
                "laps": int(state["laps"]),
                "ending": str(endings[car]),
                "race_time_s": float(state["finish_s"]) if finished[car] else None,
                "driven_s": float(driven[car]),
                "distance_m": float(distance[car]),
                "best_lap_s": float(state["best_lap_s"]) if np.isfinite(state["best_lap_s"]) else None,
                "off_course_s": float(state["off_course_s"]),
                "wall_s": float(state["wall_s"]),
                "contacts": int(state["contacts"]),
                "contacts_faster_behind": int(state["contacts_faster_behind"]),
                "contacts_at_fault": int(state["contacts_at_fault"]),
                "penalties": int(state["penalties"]),
                "stints": None if endings[car] in VOID_ENDINGS else stints.get((index, car)),
            }
        )
    return rows
