"""Pictures of the fastest lap beside the built-in driver's."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray

from benchmarks.lap_limit.flying import FlyingLaps
from nathlon.policies.lap_limit.problem import OptimalLap
from nathlon.sim.track import Track

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

LIMIT, DRIVER = "#c8590b", "#1f6fb4"


def plot(path: Path, title: str, track: Track, lap: OptimalLap, driver: FlyingLaps) -> None:
    """Write speed over distance, and both lines on the map, to an SVG file."""
    plt.rcParams.update({"font.family": "sans-serif", "font.size": 9, "svg.hashsalt": "nathlon"})
    figure, (speeds, plan) = plt.subplots(2, 1, figsize=(11, 11), height_ratios=(1, 2))
    speeds.plot(lap.distance, 3.6 * lap.states[0], color=LIMIT, label=f"limit, {lap.lap_s:.2f} s")
    speeds.plot(
        driver.distance, 3.6 * driver.speed, color=DRIVER, label=f"built-in driver, {driver.best_s:.2f} s"
    )
    speeds.set_title(title)
    speeds.set_xlabel("along the centre line, m")
    speeds.set_ylabel("speed, km/h")
    speeds.legend(frameon=False)
    for column in (0, 2):
        plan.plot(track.edges[:, column], track.edges[:, column + 4], color="#999", linewidth=0.6)
    _draw(plan, track, lap.distance, lap.states[3], LIMIT)
    _draw(plan, track, driver.distance, driver.lateral, DRIVER)
    plan.set_aspect("equal")
    plan.axis("off")
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def _draw(
    plan: Axes, track: Track, distance: NDArray[np.float64], lateral: NDArray[np.float64], colour: str
) -> None:
    x, y, _ = track.pose(distance, lateral)
    plan.plot(x, y, color=colour, linewidth=0.6)
