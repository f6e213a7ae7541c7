"""The page of a settings matrix: what got worse first, and a heat map of all cells."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nathlon.reports.self_contained import render_page, script_data, template_text, write_page_file
from nathlon.results.matrix import CellReport, MatrixFinding, MatrixMeasure, MatrixReport

DIMENSIONS = {
    "scenario": "scenario",
    "place": "starting place",
    "circuit": "circuit",
    "car": "car",
    "compound": "tyres",
    "delay_s": "delay",
    "hz": "actions",
    "blur": "blur",
    "noise": "noise",
}
"""Fields of a cell that make rows and columns, as the page calls them."""
LISTED = 40
"""Cells in the table; the heat map has them all."""
NAMES = {
    "pace": "pace",
    "place": "place",
    "off_course": "off course",
    "at_fault": "contacts at fault",
    "stopped": "stopped",
    "best_lap": "best lap",
    "lap_loss": "lap loss",
}
"""Measures whose names are not words."""


def write_matrix_page(report: MatrixReport, folder: Path) -> Path:
    """Write `folder`/index.html, whole or not at all, and return its path."""
    return write_page_file(render_matrix(report), folder / "index.html")


def render_matrix(report: MatrixReport) -> str:
    """The page's HTML, which needs no network and runs the script written here alone."""
    listed = [cell for cell in report.ordered() if cell.verdict != "no sign"][:LISTED]
    return render_page(
        "matrix.html",
        template_text("scroll.css", "gate.css", "matrix.css"),
        "matrix.js",
        report=report,
        listed=listed,
        unlisted=sum(cell.verdict != "no sign" for cell in report.cells) - len(listed),
        counts=[
            (name, sum(cell.findings[number].verdict == "worse" for cell in report.cells))
            for number, name in enumerate(map(called, report.measures))
        ],
        rows=[(measure, called(measure)) for measure in report.measures],
        differences=differences,
        groups=groups(report),
        data=script_data(payload(report)),
    )


def called(measure: MatrixMeasure) -> str:
    """A measure as the page calls it."""
    return NAMES.get(measure.name, measure.name.removeprefix("own."))


def differences(report: MatrixReport, cell: CellReport) -> list[tuple[str, MatrixFinding]]:
    """What of a cell is shown in the table: its findings in words, those called worse before the others."""
    told = [
        (amount(measure, finding), finding)
        for measure, finding in zip(report.measures, cell.findings, strict=True)
        if finding.verdict != "no sign"
    ]
    return sorted(told, key=lambda one: one[1].verdict != "worse")


def groups(report: MatrixReport) -> list[tuple[str, str, list[tuple[str, MatrixFinding]]]]:
    """The levels: dimension, name, and by measure the difference in words."""
    return [
        (
            DIMENSIONS[level.dimension],
            _level(level.dimension, level.level),
            [
                (difference(measure, finding), finding)
                for measure, finding in zip(report.measures, level.findings, strict=True)
            ],
        )
        for level in sorted(report.levels, key=lambda one: list(DIMENSIONS).index(one.dimension))
    ]


def difference(measure: MatrixMeasure, finding: MatrixFinding) -> str:
    """By how much something is worse, with its interval and unit."""
    if finding.worse is None or finding.low is None or finding.high is None:
        return ""
    scale, unit = (100.0, "%") if measure.relative else (1.0, measure.unit)
    numbers = [scale * value for value in (finding.worse, finding.low, finding.high)]
    worse, low, high = (f"{number:+.2g}" if abs(number) < 10 else f"{number:+.0f}" for number in numbers)
    return f"{worse}{'' if unit == '1' else f' {unit}'} ({low} to {high})"


def amount(measure: MatrixMeasure, finding: MatrixFinding) -> str:
    """By how much a cell is worse in a measure, with its interval."""
    return f"{called(measure)} {difference(measure, finding)}".strip()


def payload(report: MatrixReport) -> dict[str, Any]:
    """All cells for the script: levels by dimension, and numbers by cell."""
    levels = {field: list(dict.fromkeys(getattr(c, field) for c in report.cells)) for field in DIMENSIONS}
    levels["place"].sort()
    index = {field: {level: n for n, level in enumerate(those)} for field, those in levels.items()}
    verdicts = ("no sign", "unconfirmed", "worse")
    return {
        "dimensions": [
            {"field": field, "name": name, "levels": [_level(field, level) for level in levels[field]]}
            for field, name in DIMENSIONS.items()
        ],
        "measures": [
            measure.model_dump(include={"unit", "relative", "margin"}) | {"name": called(measure)}
            for measure in report.measures
        ],
        "names": [report.policy, report.baseline],
        "cells": [
            [
                [index[field][getattr(cell, field)] for field in DIMENSIONS],
                cell.runs,
                [
                    [
                        *(_short(value) for value in (f.worse, f.low, f.high, f.policy, f.baseline)),
                        verdicts.index(f.verdict),
                    ]
                    for f in cell.findings
                ],
                cell.replay,
            ]
            for cell in report.cells
        ],
    }


def _level(field: str, level: Any) -> str:
    if field == "delay_s":
        return f"{level:g} s late" if level else "no delay"
    if field == "hz":
        return f"{level:g} Hz" if level else "own rate"
    if field in ("blur", "noise"):
        return f"{field} {level:g}" if level else f"no {field}"
    if field == "place":
        return f"place {level}"
    return str(level) or "own tyres"


def _short(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.4g}")
