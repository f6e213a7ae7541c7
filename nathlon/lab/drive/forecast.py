"""The place that is expected of a person among built-in drivers, by races that the computer drives before.

Another built-in driver, of the person's pace, sits in their place on the grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import polars as pl

from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.runner import run_together
from nathlon.arena.watch import Watch
from nathlon.lab.drive.form import PACES, Form
from nathlon.policies.load import load_policy
from nathlon.policies.sources import DRIVER

RACES = 12
"""Driven for a forecast."""
SPREAD = -1.3, -0.6, 0.0, 0.6, 1.3
"""Paces of the drivers that stand for the person, in standard deviations of their form, in turn."""
FIRST_SEED = 1000
CAR_SECONDS = 100_000
"""That a forecast may simulate, some seconds of work: of longer races it drives fewer laps."""
LAP_S = 150.0
"""For reckoning with that."""


class HeatForecast(NamedTuple):
    """What is expected of a race.

    Attributes:
        pace: of the person, as `Form.pace`.
        cars: on the grid.
        place: the mean.
        low, high: between which eight of ten places lie.
        race_time_s: what the person would take, mean; None if not all laps were driven.
    """

    pace: float
    cars: int
    place: float
    low: int
    high: int
    race_time_s: float | None


class Setting(NamedTuple):
    """Where a race is and who starts from which place.

    Attributes:
        circuit, car: names.
        cars: on the grid.
        seat: the person's place on it, from pole.
        laps: of the race.
    """

    circuit: str
    car: str
    cars: int
    seat: int
    laps: int

    @property
    def driven_laps(self) -> int:
        """Laps that a forecast drives."""
        return max(1, min(self.laps, int(CAR_SECONDS / (RACES * self.cars * LAP_S))))


def foretell(setting: Setting, opponents: Sequence[str], form: Form) -> HeatForecast:
    """What is expected of a person among some built-in drivers.

    Args:
        setting: of the race.
        opponents: sources of all others, from pole.
        form: of the person.
    """
    [rows] = drive(setting, [opponents], form, RACES)
    low, high = np.quantile(rows["place"].to_numpy(), (0.1, 0.9), method="nearest").tolist()
    finished = rows["race_time_s"].drop_nulls()
    whole = setting.driven_laps == setting.laps and len(finished) > RACES // 2
    return HeatForecast(
        pace=form.pace,
        cars=setting.cars,
        place=float(np.mean(rows["place"].to_numpy())),
        low=int(low),
        high=int(high),
        # Of those that went well: a spin of whoever stands for the person is none of theirs.
        race_time_s=float(np.median(finished)) if whole else None,
    )


def drive(setting: Setting, fields: Sequence[Sequence[str]], form: Form, races: int) -> list[pl.DataFrame]:
    """Race somebody of a person's form against some fields; their rows of RESULTS, for each field.

    Args:
        setting: of the race.
        fields: sources of all others, from pole, for each field.
        form: of the person.
        races: against each field.
    """
    scenario = f"drive:laps={setting.driven_laps},cars={setting.cars}"
    paces = np.clip(form.pace + form.doubt * np.array(SPREAD), PACES[0], PACES[-1])
    persons = [f"{DRIVER}:pace={pace:.4f}" for pace in paces]
    line_ups = {}
    for number, field in enumerate(fields):
        sources = (*field, *persons)
        runs = tuple(
            Race(FIRST_SEED + race, _seats(setting, len(field), race % len(persons))) for race in range(races)
        )
        match = Match("race", "forecast", scenario, setting.circuit, setting.car, sources, sources, runs)
        line_ups[number] = match, [load_policy(source, setting.circuit, setting.car) for source in sources]
    driven = dict(run_together(line_ups, Watch()))
    return [driven[number].filter(pl.col("car") == setting.seat - 1) for number in line_ups]


def _seats(setting: Setting, others: int, person: int) -> tuple[Seat, ...]:
    order = iter(range(others))
    return tuple(
        Seat(others + person if place == setting.seat - 1 else next(order)) for place in range(setting.cars)
    )
