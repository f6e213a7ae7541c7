"""Limit lap times: shipped for the circuits and cars of nathlon, and those that were computed here."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict, ValidationError

from nathlon.sim.car import load_car
from nathlon.sim.extras import need
from nathlon.sim.track import load_track
from nathlon.sim.whole_file import write_whole

SHIPPED = Path(__file__).parent.parent.parent / "data" / "lap_limits.json"
"""Which `python -m benchmarks.lap_limit.ship` writes from the benchmark's results."""
TABLE_DIGITS = 6
"""Of a circuit's table, m and the like: processors may differ in digits beyond."""


class LapLimit(NamedTuple):
    """A limit lap time.

    Attributes:
        limit_s: the time, s.
        solved: whether the solver is content with it.
    """

    limit_s: float
    solved: bool


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True)

    circuit: str
    car: str
    limit_s: float
    track: str
    car_file: str


class _File(BaseModel):
    model_config = ConfigDict(frozen=True)

    source: str
    laps: tuple[_Entry, ...]


def known_limit(circuit: str, car: str) -> float | None:
    """The limit lap time of a circuit and car as they are now, s; None where it is not known.

    Raises:
        InputError: if one is unknown or its file is wrong.
    """
    own = place_digests(circuit, car)
    laps = [*_read(SHIPPED).laps, *_read(_computed()).laps]
    return next((lap.limit_s for lap in laps if (lap.track, lap.car_file) == own), None)


def compute_limit(circuit: str, car: str) -> LapLimit:
    """Find the limit lap time of a circuit and car, in some minutes, and keep it for reports if it is solved.

    Raises:
        InputError: if one is unknown or its file is wrong, or the extra `limit` is not installed.
    """
    track, loaded = load_track(circuit), load_car(car)
    need("casadi", "limit", "the fastest lap by optimal control")
    from nathlon.policies.lap_limit.problem import fastest_lap  # which imports casadi

    lap = fastest_lap(track, loaded)
    limit = LapLimit(round(float(lap.lap_s), 3), bool(lap.solved))
    if limit.solved:
        keep_limit(circuit, car, limit.limit_s)
    return limit


def keep_limit(circuit: str, car: str, limit_s: float) -> None:
    """Keep a limit lap time for reports made on this machine.

    Raises:
        InputError: if circuit or car is unknown or its file is wrong.
    """
    own, path = place_digests(circuit, car), _computed()
    entry = _Entry(circuit=circuit, car=car, limit_s=limit_s, **own._asdict())
    others = [other for other in _read(path).laps if (other.track, other.car_file) != own]
    content = _File(source="nathlon track limit", laps=(*others, entry))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, content.model_dump_json(indent=1) + "\n")


class PlaceDigests(NamedTuple):
    """SHA-256 of a circuit's table, rounded to `TABLE_DIGITS`, and of a car's file."""

    track: str
    car_file: str


def place_digests(circuit: str, car: str) -> PlaceDigests:
    """What a limit holds for.

    Raises:
        InputError: if one is unknown or its file is wrong.
    """
    table = load_track(circuit).table.round(TABLE_DIGITS) + 0.0  # no negative zeros
    text = json.dumps(load_car(car).model_dump(), sort_keys=True)
    return PlaceDigests(
        hashlib.sha256(table.tobytes()).hexdigest(), hashlib.sha256(text.encode()).hexdigest()
    )


def _computed() -> Path:
    """Where limits are kept that were computed on this machine."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "nathlon" / "lap_limits.json"


def _read(path: Path) -> _File:
    try:
        return _File.model_validate_json(path.read_bytes())
    except (OSError, ValidationError):
        return _File(source="", laps=())  # it can be computed again
