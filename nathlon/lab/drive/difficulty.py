"""How good the opponents of a test drive are: built-in drivers whose paces are told.

There is no other handicap: they have the same car, and do not wait for anybody.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from nathlon.lab.drive.forecast import HeatForecast, Setting, drive, foretell
from nathlon.lab.drive.form import PACES, Form, form
from nathlon.policies.sources import DRIVER, driver_settings
from nathlon.policies.temper import FAIR, TemperName
from nathlon.results.words import percent
from nathlon.sim.errors import InputError

Difficulty = Literal["chosen", "beginner", "intermediate", "expert", "match"]
CHOSEN: Difficulty = "chosen"
"""By the person, one by one."""
NOVICE: Difficulty = "beginner"
LEVELS = {"beginner": (0.74, 0.84), "intermediate": (0.84, 0.92), "expert": (0.92, 1.0)}
"""Paces of the slowest and of the fastest opponent."""
HALF_WIDTH = 0.04
"""Of the paces of a matched field, about its middle: then a place is worth more than what one drive differs
from the next."""
SHIFTS = -0.06, -0.03, 0.0, 0.03, 0.06
"""Of the middle of a matched field from the person's pace, of which it is found by driving."""
TRIALS = 4
"""Races against each of them."""


class HeatField(NamedTuple):
    """The opponents of a race, and what is expected of it.

    Attributes:
        sources: of the opponents, from pole.
        words: what the person is told of it.
        forecast: None for somebody who has not driven there.
    """

    sources: tuple[str, ...]
    words: str
    forecast: HeatForecast | None


def field(
    difficulty: Difficulty, temper: TemperName, setting: Setting, store: Path | str, name: str
) -> HeatField:
    """The opponents of a difficulty, other than those that somebody has chosen.

    Args:
        difficulty: not `chosen`.
        temper: of the opponents.
        setting: of the race.
        store: where the person's drives are.
        name: of the person.

    Raises:
        InputError: if the person shall be matched and has finished no drive there, or nobody else races.
    """
    if setting.cars < 2:
        raise InputError(f"the choice: {difficulty} and 1 car, expected at least two")
    shown = form(store, name, setting.circuit, setting.car)
    if difficulty == "match":
        if shown is None:
            raise InputError(
                f"match me: {name} has finished no drive here yet, expected one with this circuit and car "
                "before, alone or at any difficulty"
            )
        paces = matched(setting, shown, temper)
    else:
        paces = spread(*LEVELS[difficulty], setting.cars - 1)
    sources = drivers(paces, temper)
    forecast = None if shown is None else foretell(setting, sources, shown)
    return HeatField(sources, words(paces, temper, shown, forecast), forecast)


def spread(low: float, high: float, cars: int) -> list[float]:
    """Paces from the fastest to the slowest; that in the middle if there is one."""
    return [0.5 * (low + high)] if cars == 1 else np.linspace(high, low, cars).tolist()


def drivers(paces: Sequence[float], temper: str) -> tuple[str, ...]:
    """Built-in drivers of some paces and a temper."""
    return tuple(tempered(f"{DRIVER}:pace={pace:.4f}", temper) for pace in paces)


def tempered(source: str, temper: str) -> str:
    """The source of a built-in driver with a temper; other policies have that of their training."""
    if source.partition(":")[0] != DRIVER or temper == FAIR or driver_settings(source).temper != FAIR:
        return source
    return f"{source}{',' if ':' in source else ':'}temper={temper}"


def matched(setting: Setting, shown: Form, temper: str) -> list[float]:
    """Paces of opponents among whom a person is expected in the middle.

    A start from the back costs time in passing others, so fields are tried before one is chosen.

    Args:
        setting: of the race.
        shown: what the person can do.
        temper: of the opponents.
    """
    fields = [_around(shown.pace + shift, setting.cars - 1) for shift in SHIFTS]
    tried = drive(setting, [drivers(paces, temper) for paces in fields], shown, TRIALS)
    places = np.maximum.accumulate([float(np.mean(rows["place"].to_numpy())) for rows in tried])
    # As many places may be the same among fields that are all too fast: each a little worse than the last.
    places += 1e-6 * np.arange(len(places))
    middle = 0.5 * (setting.cars + 1)
    return _around(shown.pace + float(np.interp(middle, places, SHIFTS)), setting.cars - 1)


def _around(middle: float, cars: int) -> list[float]:
    """Paces about a middle; a field that would be too fast or too slow to be driven is narrower."""
    low, high = np.clip((middle - HALF_WIDTH, middle + HALF_WIDTH), PACES[0], PACES[-1]).tolist()
    return spread(low, high, cars)


def words(paces: Sequence[float], temper: str, shown: Form | None, forecast: HeatForecast | None) -> str:
    """What a person is told of their opponents and of themselves."""
    fast, slow = max(paces), min(paces)
    between = percent(fast, 1) if len(paces) == 1 else f"{100 * slow:.1f} to {percent(fast, 1)}"
    told = f"Opponents: the built-in driver at {between} of its pace, {temper}; no other handicap."
    if shown is None or forecast is None:
        return told
    drives = "drive" if shown.drives == 1 else f"{shown.drives} drives"
    told += f" You drive like it at {percent(shown.pace, 1)}, by your last {drives} here."
    likely = f"{forecast.low}" if forecast.low == forecast.high else f"{forecast.low} to {forecast.high}"
    return f"{told} Forecast: place {forecast.place:.1f} of {forecast.cars}, likely {likely}."
