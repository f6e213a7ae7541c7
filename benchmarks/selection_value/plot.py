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

BLUE, GREEN, ORANGE = "#0072b2", "#009e73", "#d55e00"
"""Of the palette of Okabe and Ito, which the colour-blind can tell apart."""
GREY = "#555555"

WITHOUT = {
    "last": ("the last checkpoint", GREEN, "--"),
    "fastest": ("the fastest lap", ORANGE, ":"),
}
"""Which one would be sent without a round robin: label, colour and style of the line."""


def plot(figures: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Draw the curves of all circuits side by side into a PNG."""
    with plt.rc_context({"font.family": "sans-serif", "font.size": 10}):
        figure, axes = plt.subplots(
            1, len(figures), figsize=(3.8 * len(figures), 4.1), sharey=True, squeeze=False
        )
        top = max(max(*one["curve"].values(), *one["leads"].values()) for one in figures.values())
        for axis, (circuit, one) in zip(axes[0], figures.items(), strict=True):
            axis.set_ylim(-0.25 * top, 1.1 * top)
            _draw(axis, one)
            axis.set_title(circuit.replace("-", " ").title(), loc="left", fontweight="bold")
        axes[0, 0].set_ylabel("points a race more than the finalists")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="lower center", ncols=len(labels), frameon=False)
        figure.tight_layout(rect=(0.0, 0.07, 1.0, 1.0))
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as partial:
            figure.savefig(partial, format="png", dpi=150, metadata={"Software": None})
        plt.close(figure)


def _draw(axis: Axes, one: Mapping[str, Any]) -> None:
    """The curve of a circuit, and whom one would send without it."""
    races, leads = zip(*sorted((int(races), lead) for races, lead in one["curve"].items()), strict=True)
    axis.axhline(0, color=GREY, linewidth=0.8)
    axis.plot(races, leads, "o-", color=BLUE, label="who is best after so many races")
    axis.plot(one["races"], one["leads"]["sent"], "D", color="black", label="who is sent", zorder=3)
    for name, (label, colour, style) in WITHOUT.items():
        lead = one["leads"][name]
        axis.axhline(lead, color=colour, linestyle=style, linewidth=1.8, label=label)
        if lead < axis.get_ylim()[0]:
            text = f"↓ {label}: {lead:.1f}".replace("-", "\N{MINUS SIGN}")
            axis.text(0.03, 0.04, text, color=colour, transform=axis.transAxes)
    axis.set_xscale("log", base=2)
    axis.set_xticks(races, [str(count) for count in races])
    axis.minorticks_off()
    axis.set_xlabel("races of the round robin")
    axis.spines[["top", "right"]].set_visible(False)
