"""Draws the learning curves of the bundled checkpoints, from the `curve.csv` of their training runs.

`.venv/bin/python -m benchmarks.curves` writes `policies/bundled/curves.svg`, the runs of each circuit and
car side by side, and prints one JSON object.
"""

from __future__ import annotations

import json
import math
from itertools import cycle
from pathlib import Path

import matplotlib
import polars as pl
from matplotlib.axes import Axes
from rich.console import Console
from rich.progress import track

from benchmarks.ladder import circuits
from benchmarks.ladders import ladder
from benchmarks.time_trial import drive_alone, limits
from nathlon.arena.entrant import enter
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.checkpoint import ANY, Card, read_card
from nathlon.policies.sources import DRIVER

matplotlib.use("Agg")
import matplotlib.pyplot as plt

COLOURS = (
    *("#1f6fb4", "#c8590b", "#3a8a3f", "#8a4fa3", "#a8823c", "#c4457d"),
    *("#e0007a", "#555555", "#0f8f8f", "#d9a400", "#7a1f1f", "#86b82a", "#111111"),
    *("#4fb3e8", "#f08a8a", "#5a4fcf", "#c9c900", "#9b6b43", "#00c2a8", "#b39ddb"),
    *("#ff4d00", "#0b3d1e", "#ff8fd0"),
)
SLOWEST = 1.12
"""Laps beyond this multiple of the fastest bundled one are cut off."""

Runs = dict[tuple[str, str], list[tuple[Path, list[Card]]]]


def bundled_runs() -> Runs:
    """The curves of the runs that checkpoints are bundled of, with the cards of these, by circuit and car.

    Those of any circuit are left out: their laps are means over several.
    """
    runs: Runs = {}
    for curve in sorted((BUNDLED / "curves").glob("*.csv")):
        cards = [
            read_card(path)
            for circuit in circuits()
            for path in ladder(circuit)
            if path.name.startswith(f"{curve.stem}-")
        ]
        if cards and cards[0].circuit != ANY:
            runs.setdefault((cards[0].circuit, cards[0].car), []).append((curve, cards))
    return runs


def style(curve: Path) -> str:
    """What a run is called among those of its circuit."""
    return curve.stem.rpartition("-")[2]


def draw_run(laps: Axes, off: Axes, path: Path, cards: list[Card], colour: str) -> float | None:
    """Draw one run; returns its best mean lap, s."""
    curve = pl.read_csv(path, null_values="nan", schema_overrides={"lap_s": pl.Float64})
    lap = curve.filter(pl.col("lap_s").is_not_null())
    chosen = lap.filter(pl.col("updates").is_in([card.step for card in cards]))
    laps.plot(lap["updates"] / 1000, lap["lap_s"], color=colour, label=style(path))
    laps.plot(chosen["updates"] / 1000, chosen["lap_s"], "o", color=colour, markersize=4)
    off.plot(curve["updates"] / 1000, 100 * curve["off_course_share"], color=colour)
    return min(lap["lap_s"].to_list(), default=None)


def draw_references(laps: Axes, circuit: str, car: str) -> None:
    """Draw the built-in driver's lap, and the fastest there is where it is known."""
    driver_s = drive_alone(enter(DRIVER, circuit, car)).lap_s
    laps.axhline(driver_s, color="#666", linewidth=0.8, linestyle="--", label="built-in driver")
    limit_s = limits().get((circuit, car))
    if limit_s is not None:
        laps.axhline(limit_s, color="#666", linewidth=0.8, linestyle=":", label="fastest lap there is")


def main() -> None:
    """Draw all runs in `policies/bundled/curves`."""
    plt.rcParams.update({"font.family": "sans-serif", "font.size": 9, "svg.hashsalt": "nathlon"})
    runs = bundled_runs()
    figure, axes = plt.subplots(
        2, len(runs), figsize=(max(7, 4 * len(runs)), 5), sharex="col", height_ratios=(2, 1), squeeze=False
    )
    styles = sorted({style(path) for those in runs.values() for path, _ in those})
    colours = dict(zip(styles, cycle(COLOURS)))
    best: dict[str, float | None] = {}
    console = Console(stderr=True)
    for (laps, off), (circuit, car) in track(
        list(zip(axes.T, runs, strict=True)), "circuits", console=console
    ):
        for path, cards in runs[circuit, car]:
            best[path.stem] = draw_run(laps, off, path, cards, colours[style(path)])
        draw_references(laps, circuit, car)
        fastest = min(best[path.stem] or math.inf for path, _ in runs[circuit, car])
        laps.set_ylim(top=min(laps.get_ylim()[1], SLOWEST * fastest))
        laps.set_title(f"{circuit}, {car}", fontsize=9)
        off.set_yscale("symlog", linthresh=1)
        off.set_ylim(0, 100)
        off.set_yticks([0, 1, 10, 100], ["0", "1", "10", "100"])
        off.set_xlabel("thousand updates")
        for axis in (laps, off):
            axis.spines[["top", "right"]].set_visible(False)
    axes[0, 0].set_ylabel("mean lap, s (dots: bundled)")
    axes[1, 0].set_ylabel("off course, % of time")
    labelled = {
        label: line for laps in axes[0] for line, label in zip(*laps.get_legend_handles_labels(), strict=True)
    }
    labels = sorted(labelled, key=lambda label: (label not in styles, label))
    lines = [labelled[label] for label in labels]
    figure.legend(lines, labels, loc="lower center", ncols=math.ceil(len(labels) / 2), frameon=False)
    figure.tight_layout(rect=(0.0, 0.1, 1.0, 1.0))
    figure.savefig(BUNDLED / "curves.svg", metadata={"Date": None})
    print(json.dumps({"best_lap_s": best}))


if __name__ == "__main__":
    main()
