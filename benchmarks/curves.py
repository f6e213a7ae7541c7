"""Draws the learning curves of the bundled checkpoints, from the `curve.csv` of their training runs.

`.venv/bin/python -m benchmarks.curves` writes `policies/bundled/curves.svg` and prints one JSON object.
"""

from __future__ import annotations

import json

import matplotlib
import polars as pl
from rich.progress import track

from arena.entrant import enter
from benchmarks.bundled import alone
from policies.bundled import BUNDLED
from policies.checkpoint import read_card

matplotlib.use("Agg")
import matplotlib.pyplot as plt

COLOURS = ("#1f6fb4", "#c8590b")


def main() -> None:
    """Draw all runs in `policies/bundled/curves`."""
    plt.rcParams.update({"font.family": "sans-serif", "font.size": 9, "svg.hashsalt": "nathlon"})
    figure, (laps, off) = plt.subplots(2, 1, figsize=(7, 5), sharex=True, height_ratios=(2, 1))
    best = {}
    runs = sorted((BUNDLED / "curves").glob("*.csv"))
    for path, colour in track(list(zip(runs, COLOURS, strict=True)), description="runs"):
        curve = pl.read_csv(path, null_values="nan")
        kept = [read_card(checkpoint).step for checkpoint in BUNDLED.glob(f"{path.stem}-*.safetensors")]
        lap = curve.filter(pl.col("lap_s").is_not_null())
        chosen = lap.filter(pl.col("updates").is_in(kept))
        laps.plot(lap["updates"] / 1000, lap["lap_s"], color=colour, label=path.stem)
        laps.plot(chosen["updates"] / 1000, chosen["lap_s"], "o", color=colour, markersize=4)
        off.plot(curve["updates"] / 1000, 100 * curve["off_course_share"], color=colour)
        best[path.stem] = lap["lap_s"].min()
    driver = alone(enter("driver", "lindenring", "gt3"))["lap_s"]
    laps.axhline(driver, color="#666", linewidth=0.8, linestyle="--", label="built-in driver")
    laps.set_ylabel("mean lap, s (dots: bundled)")
    laps.legend(frameon=False)
    off.set_ylabel("off course, % of time")
    off.set_yscale("symlog", linthresh=1)
    off.set_ylim(0, 100)
    off.set_yticks([0, 1, 10, 100], ["0", "1", "10", "100"])
    off.set_xlabel("thousand updates")
    for axis in (laps, off):
        axis.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(BUNDLED / "curves.svg", metadata={"Date": None})
    print(json.dumps({"best_lap_s": best}))


if __name__ == "__main__":
    main()
