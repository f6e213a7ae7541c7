"""The player: a race as one web page that plays without a network and without a graphics card."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray

from arena.circuit_mesh import KERB, ROAD, RUNOFF
from arena.race_log import NOTICES, Outline, RaceLog, progress
from reports.replay import car_colours, labels, winner
from sim.track import SURFACES

TEMPLATES = Path(__file__).parent / "templates"

STEPS = {
    "x": 0.02,  # m
    "y": 0.02,
    "yaw": 0.002,  # rad
    "speed": 0.05,  # m/s
    "distance": 0.1,  # m, to be compared between cars
    "steering": 0.01,
    "throttle": 0.01,
    "brake": 0.01,
    "slipstream": 0.02,
    "penalty": 0.1,  # s
    "place": 1,
    "lap": 1,
    "gear": 1,
    "flags": 1,
}
"""Columns of the samples, and to what each is rounded."""
FLAGS = ("driving", "off_course", "wall_contact", "car_contact")
"""Bits of the column `flags`, the lowest first."""
OUTLINE_STEP_M = 0.05


def write_player(log: RaceLog, path: Path, follow: int | None = None) -> None:
    """Write the page, at first with the camera on car `follow` (the winner if None), whole or not at all."""
    html = render_player(log, follow)
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_text(html, "utf-8")
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def render_player(log: RaceLog, follow: int | None = None) -> str:
    """The page's HTML. Its policy admits only the style and the script written here, by their hashes."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style = (TEMPLATES / "player.css").read_text("utf-8")
    script = (TEMPLATES / "player.js").read_text("utf-8")
    return environment.get_template("player.html").render(
        log=log,
        race=Markup(_script_json(_race(log, winner(log) if follow is None else follow))),
        policy=f"default-src 'none'; style-src {_digest(style)}; script-src {_digest(script)}; "
        "img-src data:; base-uri 'none'; form-action 'none'",
        style=Markup(style),
        script=Markup(script),
    )


def _race(log: RaceLog, followed: int) -> dict[str, Any]:
    """What the script plays."""
    return {
        "followed": followed,
        "cars": [
            {"name": name, "team": team, "colour": _css(colour)}
            for name, team, colour in zip(labels(log), log.teams, car_colours(log.teams), strict=True)
        ],
        "length": log.car_length_m,
        "width": log.car_width_m,
        "ticks": len(log.time_s),
        "time": _packed(np.rint(log.time_s * 1000.0)[None]),
        "columns": [{"name": name, "step": step} for name, step in STEPS.items()],
        "samples": _packed(_columns(log)),
        "flags": FLAGS,
        "circuit": _circuit(log.outline),
        "incidents": [
            {
                "time": round(incident.time_s, 3),
                "kind": incident.kind,
                "cars": incident.cars,
                "text": incident.text,
                "notice": incident.kind in NOTICES,
            }
            for incident in log.incidents
        ],
    }


def _columns(log: RaceLog) -> NDArray[np.float64]:
    """One row of T whole numbers a car, for each column in turn."""
    samples = log.samples
    flags = sum(samples[name].astype(np.int64) << bit for bit, name in enumerate(FLAGS))
    values = {
        "x": samples["x_m"],
        "y": samples["y_m"],
        "yaw": np.unwrap(samples["yaw_rad"], axis=0),
        "speed": np.hypot(samples["velocity_x_m_s"], samples["velocity_y_m_s"]),
        "distance": progress(log),
        "penalty": samples["penalty_s"],
        "flags": flags,
    }
    columns = [values[name] if name in values else samples[name] for name in STEPS]
    return np.concatenate(
        [np.rint(column / step).T for column, step in zip(columns, STEPS.values(), strict=True)]
    )


def _circuit(outline: Outline) -> dict[str, Any]:
    lines = ("wall_left", "kerb_left", "left", "right", "kerb_right", "wall_right")
    points = np.concatenate([getattr(outline, line)[:, :2].T for line in lines])
    return {
        "rows": len(outline.centre),
        "lines": lines,
        "step": OUTLINE_STEP_M,
        "points": _packed(np.rint(points / OUTLINE_STEP_M)),
        "runoff": _packed(np.stack([outline.runoff_left, outline.runoff_right, outline.zone])),
        "surfaces": [_css(RUNOFF.get(name, ROAD)) for name in SURFACES],
        "road": _css(ROAD),
        "kerb": [_css(colour) for colour in KERB],
    }


def _packed(rows: NDArray[Any]) -> str:
    """Rows of whole numbers as differences along each row, 32-bit little-endian, deflated, in base64."""
    differences = np.ascontiguousarray(np.diff(rows, axis=1, prepend=0), "<i4")
    # The bytes of one weight together: they are alike.
    planes = differences.view(np.uint8).reshape(-1, 4).T
    return base64.b64encode(zlib.compress(planes.tobytes(), 9)).decode()


def _css(colour: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)


def _script_json(value: Any) -> str:
    """JSON that can stand in a script element: nothing in it ends the element."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
