"""A recorded race as the scripts of player and report read it: whole numbers, packed."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.circuit_mesh import KERB, LANE_M, ROAD, RUNOFF, WALLS
from nathlon.arena.passes import passes
from nathlon.arena.race_log import NOTICES, NamedStretch, Outline, RaceLog, lap_length, origin, progress
from nathlon.reports.cars import car_colours, labels
from nathlon.reports.seen_pictures import camera_of, proportion, seen_pictures
from nathlon.sim.track import SURFACES

STEPS = {
    "x": 0.02,  # m
    "y": 0.02,
    "z": 0.02,
    "pitch": 0.002,  # rad
    "roll": 0.002,
    "yaw": 0.002,
    "speed": 0.05,  # m/s
    "distance": 0.1,  # m, to be compared between cars
    "steering": 0.01,
    "throttle": 0.01,
    "brake": 0.01,
    "slipstream": 0.02,
    "penalty": 0.1,  # s
    "place": 1,
    "lap": 1,
    "driving": 1,
}
"""Columns of the samples, and to what each is rounded."""
SAMPLE_S = 0.1
"""Between two samples, at least, but for the last."""
OUTLINE_STEP_M = 0.05
SIGHT_S, MOST_SIGHTS, SIGHT_STEP = 0.25, 1_000, 16
"""Between two pictures of what a car saw, at least; how many there are of all cars, at most; and to what
their colours are rounded, as pages are to stay small."""


def race_data(log: RaceLog) -> dict[str, Any]:
    """The race as JSON values, without its circuit."""
    rows = _rows(log.time_s)
    return {
        "match": log.match,
        "race": log.race,
        "cars": [
            {"name": name, "team": team, "colour": _css(colour)}
            for name, team, colour in zip(labels(log), log.teams, car_colours(log), strict=True)
        ],
        "kind": log.car,
        "length": log.car_length_m,
        "width": log.car_width_m,
        "origin": round(origin(log), 1),
        "ticks": len(rows),
        "time": packed(np.rint(log.time_s[rows] * 1000.0)[None]),
        "columns": [{"name": name, "step": step} for name, step in STEPS.items()],
        "samples": packed(_columns(log, rows)),
        "incidents": [
            {
                "time": round(incident.time_s, 3),
                "kind": incident.kind,
                "cars": incident.cars,
                "text": incident.text,
                "notice": incident.kind in NOTICES,
                "fault": incident.fault,
                "closing": round(incident.closing_m_s, 1),
                "penalty": round(incident.penalty_s, 1),
            }
            for incident in log.incidents
        ],
        "passes": [
            {
                "time": round(one.time_s, 1),
                "car": one.car,
                "passed": one.passed,
                "place": one.place,
                "x": round(one.x_m),
                "y": round(one.y_m),
                "section": one.section,
            }
            for one in passes(log)
        ],
        "sights": _sights(log),
    }


def _sights(log: RaceLog) -> list[dict[str, Any]]:
    """What cars with cameras saw: rows of whole numbers, one a byte of a picture, a column for each time."""
    seeing = [car for car in range(len(log.names)) if camera_of(log, car)]
    if not seeing or not len(log.time_s):
        return []
    between_s = max(SIGHT_S, float(np.ptp(log.time_s)) * len(seeing) / MOST_SIGHTS)
    time_s = np.arange(log.time_s[0], log.time_s[-1], between_s)
    found = []
    for car in seeing:
        pictures = seen_pictures(log, car, time_s)
        camera = camera_of(log, car)
        assert camera is not None, "it sees by one"
        found.append(
            {
                "car": car,
                "width": camera.width,
                "height": camera.height,
                "proportion": round(proportion(camera), 3),
                "first": round(float(log.time_s[0]), 3),
                "between": between_s,
                "count": len(time_s),
                "step": SIGHT_STEP,
                "pixels": packed((pictures.reshape(len(time_s), -1).T // SIGHT_STEP).astype(np.int32)),
            }
        )
    return found


def circuit_data(outline: Outline, sections: Sequence[NamedStretch]) -> dict[str, Any]:
    """The circuit of a race as JSON values."""
    lines = ("wall_left", "kerb_left", "left", "right", "kerb_right", "wall_right")
    points = np.concatenate([getattr(outline, line)[:, :2].T for line in lines])
    heights = np.stack([getattr(outline, line)[:, 2] for line in lines])
    return {
        "rows": len(outline.centre),
        "lap": round(lap_length(outline), 1),
        "lines": lines,
        "step": OUTLINE_STEP_M,
        "points": packed(np.rint(points / OUTLINE_STEP_M)),
        "heights": packed(np.rint(heights / OUTLINE_STEP_M)),
        "runoff": packed(np.stack([outline.runoff_left, outline.runoff_right, outline.zone, outline.lane])),
        "lane": LANE_M,
        "surfaces": [_css(RUNOFF.get(name, ROAD)) for name in SURFACES],
        "road": _css(ROAD),
        "kerb": [_css(colour) for colour in KERB],
        "walls": {side: [_css(colour) for colour in panels] for side, panels in WALLS.items()},
        "sections": [
            {"name": section.name, "start": section.start_m, "end": section.end_m} for section in sections
        ],
    }


def _rows(time_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """Ticks that are kept: SAMPLE_S apart, and the last."""
    kept: list[int] = []
    for tick, now_s in enumerate(time_s.tolist()):
        if not kept or now_s - time_s[kept[-1]] > SAMPLE_S - 1e-6 or tick == len(time_s) - 1:
            kept.append(tick)
    return np.array(kept, np.int64)


def _columns(log: RaceLog, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """One row of whole numbers a car, for each column in turn."""
    samples = log.samples[rows]
    values = {
        "x": samples["x_m"],
        "y": samples["y_m"],
        "z": samples["z_m"],
        "pitch": samples["pitch_rad"],
        "roll": samples["roll_rad"],
        "yaw": np.unwrap(samples["yaw_rad"], axis=0),
        "speed": np.hypot(samples["velocity_x_m_s"], samples["velocity_y_m_s"]),
        "distance": progress(log)[rows],
        "penalty": samples["penalty_s"],
    }
    columns = [values[name] if name in values else samples[name] for name in STEPS]
    return np.concatenate(
        [np.rint(column / step).T for column, step in zip(columns, STEPS.values(), strict=True)]
    )


def packed(rows: NDArray[Any]) -> str:
    """Rows of whole numbers as differences along each row, 32-bit little-endian, deflated, in base64."""
    differences = np.ascontiguousarray(np.diff(rows, axis=1, prepend=0), "<i4")
    # The bytes of one weight together: they are alike.
    planes = differences.view(np.uint8).reshape(-1, 4).T
    return base64.b64encode(zlib.compress(planes.tobytes(), 9)).decode()


def _css(colour: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
