"""Results of simulated races, for the tests of what is made from results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import polars as pl

from nathlon.arena.classification import PLACE_POINTS
from nathlon.arena.results import RESULTS

DEFAULTS: dict[str, Any] = {
    "match": "m",
    "stage": "tournament",
    "test": "round_robin",
    "race": 0,
    "seed": 0,
    "mirrored": False,
    "car": 0,
    "slot": 1,
    "entrant": "a",
    "team": -1,
    "place": 1,
    "points": 0.0,
    "laps": 3,
    "ending": "finished",
    "race_time_s": 300.0,
    "driven_s": 300.0,
    "distance_m": 10_000.0,
    "best_lap_s": 95.0,
    "off_course_s": 0.0,
    "wall_s": 0.0,
    "contacts": 0,
    "contacts_faster_behind": 0,
    "contacts_at_fault": 0,
    "penalties": 0,
    "score": None,
    "measures": None,
    "stints": None,
}


def rows(columns: Mapping[str, Any], height: int) -> pl.DataFrame:
    """RESULTS of the given height: the columns given, values or constants, and plain ones for the rest."""
    filled = {name: columns.get(name, plain) for name, plain in DEFAULTS.items()}
    return pl.DataFrame(
        {
            name: np.asarray(value).tolist() if np.ndim(value) else [value] * height
            for name, value in filled.items()
        },
        schema=RESULTS,
    )


def tournament(
    pace: Mapping[str, float],
    pairs: int,
    rng: np.random.Generator,
    grid_advantage: float = 0.25,
    pair_effect: float = 0.4,
) -> pl.DataFrame:
    """A round robin of 4v4 races: the order at the flag is pace, grid place, luck of the pair and of the car.

    `pair_effect` is the spread of what helps one team in both races of a mirrored pair.
    """
    matchups = list(combinations(pace, 2))
    shape = (len(matchups), pairs, 2, 8)  # matchup, pair, race, car
    match, pair, race, car = np.indices(shape)
    team = (car + race) % 2
    names = np.array(matchups)[match, team]
    home = pair_effect * rng.standard_normal(shape[:2])[..., None, None] * (team == 0)
    performance = (
        np.vectorize(pace.__getitem__)(names) + home - grid_advantage * car + rng.standard_normal(shape)
    )
    place = 1 + np.argsort(np.argsort(-performance, axis=-1), axis=-1)
    columns = {
        "match": np.array([f"{a} v {b}" for a, b in matchups])[match],
        "race": 2 * pair + race,
        "mirrored": race == 1,
        "car": car,
        "slot": car + 1,
        "entrant": names,
        "team": team,
        "place": place,
        "points": np.array(PLACE_POINTS, dtype=float)[place - 1],
        "contacts": rng.poisson(0.5, shape),
    }
    return rows({name: value.ravel() for name, value in columns.items()}, car.size)


def duels(differences: Mapping[tuple[str, str], Sequence[float]]) -> pl.DataFrame:
    """1v1 matches with these point differences of their units; the better finishes first."""
    frames = []
    for (home, away), gaps in differences.items():
        gap = np.repeat(gaps, 4)
        side = np.arange(len(gap)) % 2
        frames.append(
            rows(
                {
                    "match": f"{home} v {away}",
                    "race": np.arange(len(gap)) // 2,
                    "mirrored": np.arange(len(gap)) // 2 % 2 == 1,
                    "team": side,
                    "entrant": np.where(side == 0, home, away),
                    "points": 9.0 + np.where(side == 0, gap, -gap) / 2,
                    "place": np.where((gap > 0) == (side == 0), 1, 2),
                },
                len(gap),
            )
        )
    return pl.concat(frames)
