"""A round circuit with laps and a training curve, for the tests of the page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl

from nathlon.arena.results import COURSE, CURVES, LAPS
from nathlon.results.selection import Selection

RADIUS_M = 500.0
ROWS = 200
SECTIONS = ("Parade", "Gate", "Quay", "")
LEAST_S = 62.0
"""The lap time of the built-in driver's line."""


def with_laps(selection: Selection, laps_s: dict[str, float]) -> Selection:
    """The selection with laps of these entrants, each with its time, and the curve of a training run.

    Each drove it in a time trial; the other columns of its result are those of the selection's first.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, ROWS + 1)
    distance = RADIUS_M * angle

    def ring(radius: float, left: str = "") -> dict[str, np.ndarray]:
        return {f"{left}x_m": radius * np.cos(angle), f"{left}y_m": radius * np.sin(angle)}

    def driven(lap_s: float) -> dict[str, np.ndarray]:
        speed = distance[-1] / lap_s
        return {"time_s": distance / speed, "speed_m_s": speed * (1.0 + 0.3 * np.sin(3.0 * angle))}

    course = {
        "distance_m": distance,
        "section": [SECTIONS[min(row * len(SECTIONS) // ROWS, len(SECTIONS) - 1)] for row in range(ROWS + 1)],
        **ring(RADIUS_M - 6.0, "left_"),
        **ring(RADIUS_M + 6.0, "right_"),
        **ring(RADIUS_M),
        **driven(LEAST_S),
    }
    laps = [
        pl.DataFrame(
            {
                "entrant": [entrant] * (ROWS + 1),
                "distance_m": distance,
                "pedals": np.cos(5.0 * angle),
                **ring(RADIUS_M + 2.0),
                **driven(lap_s),
            }
        ).select(LAPS.names())
        for entrant, lap_s in laps_s.items()
    ]
    updates = np.arange(10_000, 210_000, 10_000)
    curve = {
        "checkpoints": ["checkpoints/"] * len(updates),
        "updates": updates,
        "transitions": 20 * updates,
        "lap_s": [None, None, *np.linspace(80.0, 64.0, len(updates) - 2)],
        "off_course_share": np.linspace(0.5, 0.0, len(updates)),
        "mean_q": np.linspace(0.0, 40.0, len(updates)),
        "entropy": np.linspace(0.0, -7.0, len(updates)),
    }
    tables = {
        "laps": pl.concat([pl.DataFrame(schema=LAPS), *laps]),
        "course": pl.DataFrame(course, schema=COURSE),
        "curves": pl.DataFrame(curve, schema=CURVES),
    }
    trials = [
        selection.results[:1].with_columns(
            match=pl.lit(f"{place:064x}"),
            stage=pl.lit("pareto"),
            test=pl.lit("time_trial"),
            race=pl.lit(0, pl.Int64),
            entrant=pl.lit(entrant),
            best_lap_s=pl.lit(lap_s),
        )
        for place, (entrant, lap_s) in enumerate(laps_s.items())
    ]
    return replace(
        selection,
        tables={**selection.tables, **tables},
        results=pl.concat([selection.results, *trials]),
    )
