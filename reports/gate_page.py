"""The page of a gate: every measure on one axis, in margins."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from nathlon.reports.gate import MARKS, cells
from nathlon.reports.self_contained import render_page, template_text, write_page_file
from nathlon.results.gate import GateFinding, GateReport

WIDTH = 320
"""Of the axis, px."""
MARGINS = 3.0
"""To how many margins on either side of 0 the axis goes."""


class Bar(NamedTuple):
    """A finding on the axis, px: its bounds and what was observed, each within the axis."""

    low: float
    high: float
    middle: float


def write_gate_page(report: GateReport, folder: Path) -> Path:
    """Write `folder`/index.html, whole or not at all, and return its path."""
    return write_page_file(render_gate(report), folder / "index.html")


def render_gate(report: GateReport) -> str:
    """The page's HTML, which needs no network and runs no script."""
    return render_page(
        "gate.html",
        template_text("scroll.css", "gate.css"),
        report=report,
        marks=MARKS,
        cells=cells,
        bar=bar,
        width=WIDTH,
        place=place,
    )


def place(margins: float) -> float:
    """Where a difference in margins lies on the axis, px from its left end."""
    return round(WIDTH * (min(max(margins, -MARGINS), MARGINS) + MARGINS) / (2 * MARGINS), 1)


def bar(finding: GateFinding) -> Bar | None:
    """Where a finding lies on the axis; None of what is not compared."""
    if finding.margin is None or finding.difference is None:
        return None
    low = finding.difference if finding.low is None else finding.low
    high = finding.difference if finding.high is None else finding.high
    return Bar(*(place(value / finding.margin) for value in (low, high, finding.difference)))
