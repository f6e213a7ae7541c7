"""The circuit and a lap to compare your own with, as the page reads them."""

from __future__ import annotations

from typing import Any

import numpy as np

from nathlon.arena.recorder import outline, stretches
from nathlon.policies.driver import Driver
from nathlon.reports.race_data import OUTLINE_STEP_M, circuit_data, packed
from nathlon.sim.car import load_car
from nathlon.sim.track import load_track

SPEED_STEP_M_S = 0.05
TIME_STEP_S = 0.001


def scenery(circuit: str, car: str) -> dict[str, Any]:
    """A circuit with its heights, the car's size, and the lap of the built-in driver, as JSON values."""
    track, body = load_track(circuit), load_car(car).body
    lines = outline(track)
    data = circuit_data(lines, stretches(track))
    return {
        "name": circuit,
        "circuit": data,
        "lap_m": track.length,
        "kind": car,
        "length": body.length_m,
        "width": body.width_m,
        "full_lock": load_car(car).steering.full_lock_rad,
        "rpm": load_car(car).engine.shift_up_rpm,
        "reference": _reference(circuit, car),
    }


def _reference(circuit: str, car: str) -> dict[str, Any]:
    """The built-in driver's lap, by rows of the circuit: its line, its speed and its time since the line."""
    line = Driver(circuit, car).line
    points = load_track(circuit).offset_line(line.offset)
    taken_s = np.cumsum(line.path.step / line.speed)
    return {
        "points": packed(np.rint(points.T / OUTLINE_STEP_M)),
        "speed": packed(np.rint(line.speed / SPEED_STEP_M_S)[None]),
        "speed_step": SPEED_STEP_M_S,
        "time": packed(np.rint((taken_s - taken_s[0]) / TIME_STEP_S)[None]),
        "lap_s": line.lap_s,
    }
