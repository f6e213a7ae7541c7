"""A race driven leg by leg; its folder keeps every leg, so that a race that was stopped goes on."""

from __future__ import annotations

import math
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np
import polars as pl
from numpy.typing import NDArray

from nathlon.arena.executor import Executor
from nathlon.arena.halt import Halt
from nathlon.arena.leg import Leg, LegDriven
from nathlon.arena.match import Match
from nathlon.arena.pool import quietly
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario
from nathlon.sim.whole_file import whole_file, writing

LEG_S = 3600.0
"""Length of a leg, s: no more of a race is lost when it is stopped."""
KEY, LAPS, RESULTS = "key", "laps", "results"
"""Arrays of a leg's file beside those of its halt."""


class RaceDriven(NamedTuple):
    """A race that is over: RESULTS, and LAP_CHART of all its laps."""

    results: pl.DataFrame
    laps: pl.DataFrame


def drive_race(
    pool: Executor,
    match: Match,
    folder: Path,
    on_leg: Callable[[int, int], None] = quietly,
    leg_s: float = LEG_S,
) -> RaceDriven:
    """Drive a match with one race, or the legs of it that the folder lacks.

    Args:
        pool: where it is driven.
        match: the match.
        folder: keeps a file a leg, `leg-01.npz` and so on.
        on_leg: told how many legs have been driven, of how many at most.
        leg_s: of a leg, whole seconds.

    Raises:
        InputError: if the folder holds another race or cannot be written, or a policy cannot be loaded.
    """
    time_s = load_scenario(match.scenario).time_s
    legs = math.ceil(time_s / leg_s)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    on_leg(0, legs)
    halt, laps = None, []
    for number in range(legs):
        path = folder / f"leg-{number + 1:02}.npz"
        driven = _read(path, match) if path.is_file() else None
        if driven is None:
            leg = Leg(number, min((number + 1) * leg_s, time_s), halt)
            answer = pool.drive_leg(match, leg)
            if isinstance(answer, InputError):
                raise answer
            driven = answer
            _write(path, match, driven)
        on_leg(number + 1, legs)
        halt = driven.halt
        laps.append(driven.laps)
        if driven.results is not None:
            return RaceDriven(driven.results, pl.concat(laps))
    raise AssertionError("the last leg ends with the race")


def _write(path: Path, match: Match, driven: LegDriven) -> None:
    frames = {LAPS: driven.laps, RESULTS: driven.results}
    tables: dict[str, Any] = {name: _packed(frame) for name, frame in frames.items() if frame is not None}
    with writing(path), whole_file(path) as partial, partial.open("wb") as file:
        np.savez_compressed(file, **(tables | driven.halt.arrays() | {KEY: np.array(match.key)}))


def _read(path: Path, match: Match) -> LegDriven:
    """A leg from its file.

    Raises:
        InputError: if it is of another race, or no leg.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays: dict[str, Any] = dict(file)
        key = str(arrays.pop(KEY))
        if key == match.key:
            laps, results = arrays.pop(LAPS), arrays.pop(RESULTS, None)
            return LegDriven(
                Halt.of(arrays), _unpacked(laps), None if results is None else _unpacked(results)
            )
    except (OSError, ValueError, KeyError, EOFError, BadZipFile, pl.exceptions.PolarsError):
        raise InputError(f"{path}: is no leg of a race of this version, expected another folder") from None
    raise InputError(
        f"{path}: is of a race with other entrants, length, circuit or seed, or of another version; "
        "expected another folder"
    )


def _packed(frame: pl.DataFrame) -> NDArray[np.uint8]:
    buffer = BytesIO()
    frame.write_ipc(buffer)
    return np.frombuffer(buffer.getvalue(), np.uint8)


def _unpacked(table: NDArray[np.uint8]) -> pl.DataFrame:
    return pl.read_ipc(BytesIO(table.tobytes()))
