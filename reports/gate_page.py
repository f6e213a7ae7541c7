"""The page of a gate: every measure on one axis, in margins."""

from __future__ import annotations

import base64
import hashlib
from pathlib import Path
from typing import NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from nathlon.reports.gate import MARKS, Finding, GateReport, cells
from nathlon.sim.whole_file import whole_file

TEMPLATES = Path(__file__).parent / "templates"
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
    path = folder / "index.html"
    with whole_file(path) as partial:
        partial.write_text(render_gate(report), encoding="utf-8")
    return path


def render_gate(report: GateReport) -> str:
    """The page's HTML, which needs no network and runs no script."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style = (TEMPLATES / "gate.css").read_text("utf-8")
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    return environment.get_template("gate.html").render(
        report=report,
        policy=f"default-src 'none'; style-src 'sha256-{digest}'; base-uri 'none'; form-action 'none'",
        style=Markup(style),
        marks=MARKS,
        cells=cells,
        bar=bar,
        width=WIDTH,
        place=place,
    )


def place(margins: float) -> float:
    """Where a difference in margins lies on the axis, px from its left end."""
    return round(WIDTH * (min(max(margins, -MARGINS), MARGINS) + MARGINS) / (2 * MARGINS), 1)


def bar(finding: Finding) -> Bar | None:
    """Where a finding lies on the axis; None of what is not compared."""
    if finding.margin is None or finding.difference is None:
        return None
    low = finding.difference if finding.low is None else finding.low
    high = finding.difference if finding.high is None else finding.high
    return Bar(*(place(value / finding.margin) for value in (low, high, finding.difference)))
