"""What the coach has found as one web page: map, traces, clips and words."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.race_log import RaceLog
from nathlon.reports.player import player_style
from nathlon.reports.race_data import circuit_data, race_data
from nathlon.reports.self_contained import render_page, script_data, template_text, write_page_file
from nathlon.results.coach import CoachFacts
from nathlon.sim.track import load_track

STEP_M = 4.0
"""Between two points of a trace."""
MOST_HEIGHT = 620.0
WIDTH = 1000.0
"""Of the map, in its own units."""
MARGIN = 40.0
SMOOTHED = 7
"""Pieces of the lap over which its loss is smoothed on the map."""
FULL_SHARE = 0.95
"""Of the pieces, which lose or gain less than what has the full colour."""


class Traces(NamedTuple):
    """How a part of a lap was driven; every array is (points,).

    Attributes:
        place_m: from the line, rising.
        time_s: since the first of these places.
        speed, pedal, lateral: m/s, from -1 to 1, and m left of the centre line.
    """

    place_m: NDArray[np.float64]
    time_s: NDArray[np.float64]
    speed: NDArray[np.float64]
    pedal: NDArray[np.float64]
    lateral: NDArray[np.float64]


class Sentences(NamedTuple):
    """Words about parts of the facts.

    Attributes:
        causes: of each section, empty where nothing is known.
        advice: what to do, and what it gained, of each advice, each the beginning of a sentence.
        unproved: where nothing can be proved and why.
        text: all of it.
    """

    causes: tuple[str, ...]
    advice: tuple[tuple[str, str], ...]
    unproved: tuple[str, ...]
    text: str


class CoachDrawing(NamedTuple):
    """All that the page shows.

    Attributes:
        log: the race.
        facts: what was found.
        words: about it.
        own, other: the laps.
        edited: of each advice, how it was driven with it.
    """

    log: RaceLog
    facts: CoachFacts
    words: Sentences
    own: Traces
    other: Traces
    edited: tuple[Traces, ...]


def write_coach_page(drawing: CoachDrawing, path: Path) -> None:
    """Write the page, whole or not at all."""
    write_page_file(render_coach_page(drawing), path)


def render_coach_page(drawing: CoachDrawing) -> str:
    """The page's HTML. Its policy admits only the style and the script written here, by their hashes."""
    facts = drawing.facts
    return render_page(
        "coach/page.html",
        player_style() + template_text("scroll.css", "coach/page.css"),
        "coach/page.js",
        facts=facts,
        words=drawing.words,
        most=max([0.001, *(abs(one.lost_s) for one in facts.sections)]),
        map=_map(drawing),
        data=script_data(_data(drawing)),
    )


def _data(drawing: CoachDrawing) -> dict[str, Any]:
    log, facts = drawing.log, drawing.facts
    return {
        "circuit": circuit_data(log.outline, log.sections),
        "race": race_data(log),
        "car": facts.car,
        "start": facts.lap.start_s,
        "sections": [{"name": one.name, "from": one.start_m, "to": one.end_m} for one in facts.sections],
        "advice": [
            {"section": one.number, "at": one.at_s, "from": one.from_m, "to": one.until_m}
            for one in facts.advice
        ],
        "own": _thinned(drawing.own),
        "other": _thinned(drawing.other),
        "edited": [_thinned(one) for one in drawing.edited],
    }


def _thinned(traces: Traces) -> dict[str, list[float]]:
    """Traces at places `STEP_M` apart, rounded to what can be seen."""
    first, last = float(traces.place_m[0]), float(traces.place_m[-1])
    at = np.linspace(first, last, max(round((last - first) / STEP_M) + 1, 2))
    rounding = {"time_s": 3, "speed": 2, "pedal": 2, "lateral": 2}
    values = {
        name: np.interp(at, traces.place_m, getattr(traces, name)).round(digits).tolist()
        for name, digits in rounding.items()
    }
    return {"place": at.round(1).tolist(), **values}


def _map(drawing: CoachDrawing) -> dict[str, Any]:
    """Lines of the map as SVG: road, the lap in pieces, each with its loss beside the most, labels."""
    log, facts, own, other = drawing.log, drawing.facts, drawing.own, drawing.other
    track = load_track(log.circuit)
    outline = log.outline
    corners = np.concatenate([outline.left[:, :2], outline.right[:, :2]])
    low, size = corners.min(axis=0), np.ptp(corners, axis=0)
    scale = min((WIDTH - 2 * MARGIN) / size[0], (MOST_HEIGHT - 2 * MARGIN) / size[1])
    height = float(size[1] * scale + 2 * MARGIN)

    def drawn(points: NDArray[np.float64]) -> NDArray[np.float64]:
        across = (points[:, :2] - low) * scale + MARGIN
        return np.stack([across[:, 0] + (WIDTH - 2 * MARGIN - size[0] * scale) / 2, height - across[:, 1]], 1)

    steps = np.arange(0.0, own.place_m[-1], 3 * STEP_M)
    lateral = np.interp(steps, own.place_m, own.lateral)
    x, y, _ = track.pose(steps, lateral)
    lap = drawn(np.stack([x, y], axis=1))
    lost = np.interp(steps, own.place_m, own.time_s) - np.interp(steps, other.place_m, other.time_s)
    rate = np.convolve(np.diff(lost), np.full(SMOOTHED, 1.0 / SMOOTHED), "same")
    rate /= max(float(np.quantile(np.abs(rate), FULL_SHARE)), 1e-6)
    pieces = [
        {
            "path": _path(lap[index : index + 2]),
            "lost": round(float(rate[index]), 2),
        }
        for index in range(len(rate))
    ]
    advised = {one.number: place for place, one in enumerate(facts.advice, 1)}
    most_s = max((one.lost_s for one in facts.sections), default=0.0)
    labels = []
    for number, one in enumerate(facts.sections):
        # A straight has a figure only where it matters: the map has no room for all.
        if one.kind == "straight" and number not in advised and one.lost_s < most_s:
            continue
        middle = np.array([0.5 * (one.start_m + one.end_m)])
        row = int(middle[0] / track.spacing) % len(outline.centre)
        centre = drawn(outline.centre[row : row + 1])[0]
        labels.append(
            {
                "x": round(float(centre[0]), 1),
                "y": round(float(centre[1]), 1),
                "right": bool(centre[0] < WIDTH - 170),
                "name": one.name,
                "number": number,
                "lost": one.lost_s,
                "advice": advised.get(number),
            }
        )
    road = [_path(drawn(getattr(outline, side))) + "Z" for side in ("left", "right")]
    return {
        "width": WIDTH,
        "height": round(height, 1),
        "road": " ".join(road),
        "pieces": pieces,
        "labels": labels,
    }


def _path(points: Sequence[Sequence[float]] | NDArray[np.float64]) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
