"""The laps that reports show: the best time trial of each finalist, driven once more, and the limit."""

from __future__ import annotations

import json
from operator import itemgetter

import numpy as np
import polars as pl
from numpy.typing import NDArray

from nathlon.arena.job import Wanted
from nathlon.arena.match import Match
from nathlon.arena.pool import Pool
from nathlon.arena.race_log import RaceLog, lap_length, origin, progress
from nathlon.arena.results import COURSE, LAPS
from nathlon.arena.store import Store
from nathlon.arena.worlds.racing import surroundings
from nathlon.policies.driver import Driver
from nathlon.selection.pareto.objective import TIME_TRIAL
from nathlon.selection.publish.lap_limits import known_limit
from nathlon.sim.errors import InputError
from nathlon.sim.names import as_named
from nathlon.sim.physics.course import DRY
from nathlon.sim.track import LEFT, RIGHT, Track, load_track

STEP_M = 8.0
"""Between two rows of a lap, about: the road is drawn true to half a metre in its tightest bends."""


def keep_laps(store: Store, run: str, pool: Pool) -> None:
    """Put the tables `laps` and `course` of a run into its store; what is there already stays as it is.

    An entrant has no lap whose best time trial does not end again as it did: the simulator or its checkpoint
    may be another one by now.
    """
    entrants, laps = store.table(run, "entrants"), store.table(run, "laps")
    cards = {card["entrant"]: card for card in entrants.iter_rows(named=True)}
    wanted = {}
    for trial in _best_trials(store, run).iter_rows(named=True):
        card = cards[trial["entrant"]]
        if card["circuit"] and card["entrant"] not in set(laps["entrant"]):
            try:
                match = Match.from_spec(
                    store.spec(trial["match"]), {card["entrant"]: as_named(card["source"])}
                )
            except InputError:
                continue
            wanted[trial["match"]] = (
                Wanted(match, (trial["race"],), (card["name"],), store.results_of([match.key])),
                trial,
            )
    driven = []
    for match, answer in pool.record([want for want, _ in wanted.values()]):
        _, trial = wanted[match.key]
        if not isinstance(answer, InputError):
            driven.append((trial["entrant"], lap_of(answer.logs[0], trial["best_lap_s"])))
    if driven:
        frames = [
            lap.with_columns(entrant=pl.lit(entrant)).select(LAPS.names())
            for entrant, lap in sorted(driven, key=itemgetter(0))
        ]
        store.put_table(run, "laps", pl.concat([laps, *frames]))
        store.put_table(run, "course", describe_course(match.circuit, match.car))


def _best_trials(store: Store, run: str) -> pl.DataFrame:
    """RESULTS of the best time trial of whoever is shortlisted or reached the round robin."""
    listed = store.table(run, "battery").filter("shortlisted")["entrant"]
    finalists = pl.concat([listed, store.table(run, "ranking")["entrant"]])
    return (
        store.results_of_run(run, "pareto")
        .filter(
            (pl.col("test") == TIME_TRIAL)
            & pl.col("best_lap_s").is_not_null()
            & pl.col("entrant").is_in(finalists.to_list())
        )
        .sort("best_lap_s", "match", "race")
        .unique("entrant", keep="first", maintain_order=True)
    )


def lap_limit(store: Store, run: str) -> float | None:
    """The limit lap time of the run's time trials, s; None where it is not known.

    It is the minimum-time lap by optimal control (`nathlon.policies.lap_limit`), with a full tank and new
    tyres of the car's own compound; known for the shipped circuits and cars, and where it was computed.
    """
    trials = store.results_of_run(run, "pareto").filter(pl.col("test") == TIME_TRIAL)
    if trials.is_empty():
        return None
    spec = store.spec(trials["match"][0])
    try:
        today = json.loads(json.dumps(surroundings(spec["scenario"], spec["circuit"], spec["car"])))
        limit_s = known_limit(spec["circuit"], spec["car"])
    except InputError:
        return None
    scenario = spec["scenario_file"]
    as_raced = all(spec[name] == today[name] for name in ("track", "car_file"))
    dry = scenario.get("grip", DRY.model_dump()) == DRY.model_dump()
    if not (as_raced and dry) or scenario["compound"] is not None or scenario["fuel_rate"] > 0.0:
        return None
    return limit_s


def lap_of(log: RaceLog, lap_s: float) -> pl.DataFrame:
    """LAPS without the entrant of the flying lap that took `lap_s` in a race of one car."""
    track, car = load_track(log.circuit), log.samples[:, 0]
    # A car that spins moves backwards for a moment.
    place = np.maximum.accumulate(origin(log) + progress(log)[:, 0])
    length = lap_length(log.outline)
    lines = length * np.arange(np.ceil(place[0] / length), np.rint(place[-1] / length) + 1)
    crossed = np.interp(lines, place, log.time_s)
    lap = int(np.argmin(np.abs(np.diff(crossed) - lap_s)))
    within = (place > lines[lap]) & (place < lines[lap + 1])
    distance = _distances(track)
    # A car that finishes stands still until the tick is over: when it crossed the line, the log cannot tell.
    along = np.concatenate([[0.0], place[within] - lines[lap], [length]])
    seconds = np.concatenate([[0.0], log.time_s[within] - crossed[lap], [lap_s]])
    at = lines[lap] + distance
    speed = np.hypot(car["velocity_x_m_s"], car["velocity_y_m_s"])
    columns = {
        "distance_m": distance,
        "time_s": np.interp(distance, along, seconds),
        "x_m": np.interp(at, place, car["x_m"]),
        "y_m": np.interp(at, place, car["y_m"]),
        "speed_m_s": np.interp(at, place, speed),
        "pedals": np.interp(at, place, car["throttle"] - car["brake"]),
    }
    return _rounded(columns)


def describe_course(circuit: str, car: str) -> pl.DataFrame:
    """COURSE of a circuit, with the line that the built-in driver follows in this car."""
    track, line = load_track(circuit), Driver(circuit, car).line
    distance = _distances(track)
    speed = np.append(line.speed, line.speed[0])
    seconds = np.concatenate([[0.0], np.cumsum(2.0 * line.path.step / (speed[:-1] + speed[1:]))])
    rows = np.arange(len(speed)) * track.spacing

    def place(offset: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        points = track.offset_line(offset)
        x, y = (np.interp(distance, rows, np.append(part, part[0])) for part in points[:, :2].T)
        return x, y

    (left_x, left_y), (right_x, right_y) = place(track.table[:, LEFT]), place(-track.table[:, RIGHT])
    x, y = place(line.offset)
    columns = {
        "distance_m": distance,
        "left_x_m": left_x,
        "left_y_m": left_y,
        "right_x_m": right_x,
        "right_y_m": right_y,
        "time_s": np.interp(distance, rows, seconds),
        "x_m": x,
        "y_m": y,
        "speed_m_s": np.interp(distance, rows, speed),
    }
    names = pl.Series("section", [track.section_at(at) for at in distance])
    return _rounded(columns).with_columns(names).select(COURSE.names())


def _distances(track: Track) -> NDArray[np.float64]:
    """From the line to the line again, metres along the centre line."""
    return np.linspace(0.0, track.length, round(track.length / STEP_M) + 1)


def _rounded(columns: dict[str, NDArray[np.float64]]) -> pl.DataFrame:
    """To the millisecond, centimetre and hundredth: what is drawn has no more, and the page is small."""
    digits = {"time_s": 3}
    return pl.DataFrame({name: values.round(digits.get(name, 2)) for name, values in columns.items()})
