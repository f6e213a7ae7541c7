"""What the seats of a tested entrant come to together."""

from __future__ import annotations

import json

import polars as pl

from nathlon.arena.match import BACKGROUND, TESTED
from nathlon.arena.results import RESULTS
from nathlon.arena.tested import entrant_rows


def seat(race: int, car: int, **said: object) -> dict[str, object]:
    facts = {"match": "m", "race": race, "car": car, "entrant": "e", "team": TESTED, "ending": "finished"}
    return {**dict.fromkeys(RESULTS.names()), **facts, **said}


def rows(*seats: dict[str, object]) -> pl.DataFrame:
    return pl.DataFrame(list(seats), schema=RESULTS)


def test_one_seat_is_its_own_row_to_the_bit() -> None:
    results = rows(
        seat(0, 0, score=0.1, contacts=3), seat(0, 1, team=BACKGROUND), seat(1, 0, score=0.3, contacts=2)
    )
    assert entrant_rows(results).equals(results.filter(pl.col("team") == TESTED))


def test_a_team_is_the_mean_of_its_seats() -> None:
    together = entrant_rows(
        rows(
            seat(0, 0, score=1.0, contacts=1, measures='{"a": 2.0, "b": 0.0}', best_lap_s=9.0),
            seat(0, 1, score=2.0, contacts=0, measures='{"a": 4.0, "b": 1.0}', ending="time_up"),
            seat(0, 2, score=50.0, team=BACKGROUND),
            seat(1, 0, score=7.0, ending="timed_out"),
            seat(1, 1, score=8.0, ending="time_up"),
        )
    )
    assert together.columns == RESULTS.names()
    first, second = together.sort("race").to_dicts()
    assert (first["score"], first["contacts"], first["ending"]) == (1.5, 0.5, "time_up")
    assert json.loads(first["measures"]) == {"a": 3.0, "b": 0.5}
    assert first["best_lap_s"] is None, "one of them has none"
    assert (second["score"], second["ending"], second["measures"]) == (7.5, "timed_out", None)
