"""How fast a person drives, by the test drives that they have finished."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, NamedTuple

import numpy as np

from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.runner import run_match
from nathlon.arena.store import RunRecord, Store
from nathlon.policies.load import load_policy
from nathlon.policies.sources import DRIVER

PACES = tuple(round(0.5 + 0.05 * step, 2) for step in range(11))
"""Of the built-in driver, between whose times a person's are put. Beyond the last it leaves the course."""
LAST = 3
"""Drives that count: people learn."""
LEAST_DOUBT = 0.006
"""Nobody drives two races alike."""
ONE_DOUBT = 0.015
"""Of somebody who has driven once."""


class Form(NamedTuple):
    """How fast a person drives on a circuit with a car.

    Attributes:
        pace: of the built-in driver that takes as long, one of those that it can hold.
        doubt: standard deviation of it.
        drives: that it is known by.
    """

    pace: float
    doubt: float
    drives: int


def form(store: Path | str, name: str, circuit: str, car: str) -> Form | None:
    """The form that a person's last drives in a store show; None if they have finished none there.

    Raises:
        InputError: if the store cannot be read.
    """
    if "://" not in str(store) and not Path(store).exists():
        return None
    with Store.open(store) as opened:
        drives = [
            shown
            for record in opened.runs()
            if _of(record, name, circuit, car)
            for shown in _shown(opened, record)
        ]
    # How somebody gets along with others says more of the next race than how fast they are alone.
    paces = [pace for pace, others in drives if others] or [pace for pace, _ in drives]
    paces = paces[-LAST:]
    if not paces:
        return None
    doubt = stdev(paces) if len(paces) > 1 else ONE_DOUBT
    return Form(fmean(paces), max(doubt, LEAST_DOUBT), len(paces))


def _of(record: RunRecord, name: str, circuit: str, car: str) -> bool:
    choice = record.config.get("choice", {})
    return [choice.get(key) for key in ("name", "circuit", "car")] == [name, circuit, car]


def _shown(store: Store, record: RunRecord) -> Iterator[tuple[float, bool]]:
    """The pace that a drive shows and whether others were forecast with it; none if it was not finished."""
    choice: dict[str, Any] = record.config["choice"]
    results = store.results_of_run(record.name)
    own = results.filter(results["car"] == choice["seat"] - 1).row(0, named=True)
    if own["race_time_s"] is None:
        return
    foretold: Any = store.facts(record.name).get("forecast")
    if foretold:
        # The same race as somebody of a known pace drove it: what others cost both is in neither's favour.
        yield foretold["pace"] * foretold["race_time_s"] / own["race_time_s"], True
    else:
        yield pace_of(own["race_time_s"], choice["circuit"], choice["car"], choice["laps"]), False


def pace_of(race_time_s: float, circuit: str, car: str, laps: int) -> float:
    """The pace at which the built-in driver takes as long, alone from the grid.

    Args:
        race_time_s: for all laps.
        circuit, car: what was driven.
        laps: from the grid.
    """
    times = alone_s(circuit, car, laps)
    return float(np.interp(-race_time_s, -np.array(times), PACES))


@lru_cache
def alone_s(circuit: str, car: str, laps: int) -> tuple[float, ...]:
    """What the built-in driver takes at each of PACES, alone from the grid, s."""
    sources = tuple(f"{DRIVER}:pace={pace}" for pace in PACES)
    races = tuple(Race(1, (Seat(entrant),)) for entrant in range(len(PACES)))
    match = Match("race", "pace", f"drive:laps={laps},cars=1", circuit, car, sources, sources, races)
    results = run_match(match, [load_policy(source, circuit, car) for source in sources])
    return tuple(results.sort("race")["driven_s"].to_list())
