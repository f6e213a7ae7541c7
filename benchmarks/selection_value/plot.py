"""The picture of what more races bring."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib

from nathlon.sim.whole_file import whole_file

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

BLUE, ORANGE, GREEN = "#0072b2", "#d55e00", "#009e73"
"""Of the palette of Okabe and Ito, which the colour-blind can tell apart."""
GREY = "#555555"


def plot(figures: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Draw the curves of all circuits side by side into a PNG."""
    with plt.rc_context({"font.family": "sans-serif", "font.size": 10}):
        figure, axes = plt.subplots(
            1, len(figures), figsize=(4.2 * len(figures), 3.9), sharey=True, squeeze=False
        )
        top = max(max(one["curve"].values()) for one in figures.values())
        bottom = -0.4 * top
        for axis, (circuit, one) in zip(axes[0], figures.items(), strict=True):
            _draw(axis, one, bottom)
            axis.set_title(circuit.replace("-", " ").title(), loc="left", fontweight="bold")
            axis.set_ylim(bottom, 1.25 * top)
        axes[0, 0].set_ylabel("points a race more than the finalists")
        figure.tight_layout()
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as partial:
            figure.savefig(partial, format="png", dpi=150, metadata={"Software": None})
        plt.close(figure)


def _draw(axis: Axes, one: Mapping[str, Any], bottom: float) -> None:
    """The curve of a circuit, and who is sent without a round robin."""
    races, leads = zip(*sorted((int(races), lead) for races, lead in one["curve"].items()), strict=True)
    axis.axhline(0, color=GREY, linewidth=0.8)
    axis.plot(races, leads, "o-", color=BLUE, label="best of so many races")
    for name, colour, style in (("last", GREEN, "--"), ("fastest", ORANGE, ":")):
        label = "the last checkpoint" if name == "last" else "the fastest lap"
        lead = one["leads"][name]
        if lead < bottom:
            axis.plot([], [], style, color=colour, linewidth=1.8, label=f"{label}: {lead:+.1f}, below")
        else:
            axis.axhline(lead, color=colour, linestyle=style, linewidth=1.8, label=label)
    axis.plot(one["races"], one["leads"]["sent"], "D", color="black", label="the selection")
    if one["enough"] is not None:
        axis.axvline(one["enough"], color=GREY, linewidth=0.8, linestyle="-.")
    axis.set_xscale("log", base=2)
    axis.set_xticks(races, [str(count) for count in races])
    axis.minorticks_off()
    axis.set_xlabel("races of the round robin")
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(frameon=False, fontsize=8, loc="lower right")
