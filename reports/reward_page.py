"""The page of a reward's design: every formula with its curve, its clips and its comparisons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from nathlon.reports.player import player_style
from nathlon.reports.self_contained import render_page, script_data, template_text, write_page_file

CURVE = (150.0, 40.0)
"""Width and height of a curve, in its own units."""
MARGIN = 3.0


class CurvePoint(NamedTuple):
    """A checkpoint of a training: its mean lap, None unless all were driven, and share of time off course."""

    updates: int
    lap_s: float | None
    off_course: float


class Shown(NamedTuple):
    """A formula as the page shows it.

    Attributes:
        name: `2.7` is the seventh of the second round.
        formula, why: as it was proposed.
        tac, error: the trajectory alignment coefficient with its standard error; None if it was thrown out.
        refused: why it was thrown out, or why its training failed; empty if neither.
        curve: of its training; empty without one.
        strength: Bradley and Terry's; None if it was not compared.
        measured: means of its clips, by name; empty without any.
        lap_s: of its last checkpoint; None if it completed none.
        carried: whether it comes from an earlier round.
    """

    name: str
    formula: str
    why: str
    tac: float | None = None
    error: float | None = None
    refused: str = ""
    curve: tuple[CurvePoint, ...] = ()
    strength: float | None = None
    measured: Mapping[str, float] = {}
    lap_s: float | None = None
    carried: bool = False


class RoundShown(NamedTuple):
    """A round.

    Attributes:
        number: from 1.
        trained: the strongest first.
        left: those with a coefficient that were not trained.
        refused: those thrown out.
        wins: of the row's against the column's, in the order of `trained`; a draw counts half; None for
            themselves.
        remarks: of the judges.
    """

    number: int
    trained: tuple[Shown, ...]
    left: tuple[Shown, ...]
    refused: tuple[Shown, ...]
    wins: tuple[tuple[float | None, ...], ...]
    remarks: tuple[str, ...]


class RewardDrawing(NamedTuple):
    """All that the page shows.

    Attributes:
        task: in words.
        facts: what it was made of, name and value.
        preferences: how many before the first round.
        rounds: those that are over.
        winner: after its last training; None before.
        checkpoint: of the winner, from the page's folder; empty before.
        card: of that checkpoint, name and value.
        circuit: of all clips, as the player reads it.
        clips: races by name, as the player reads them.
        car: index of the car in question.
    """

    task: str
    facts: tuple[tuple[str, str], ...]
    preferences: int
    rounds: tuple[RoundShown, ...]
    winner: Shown | None
    checkpoint: str
    card: tuple[tuple[str, str], ...]
    circuit: Mapping[str, Any]
    clips: Mapping[str, Sequence[Mapping[str, Any]]]
    car: int


def write_reward_page(drawing: RewardDrawing, path: Path) -> None:
    """Write the page, whole or not at all."""
    write_page_file(render_reward_page(drawing), path)


def render_reward_page(drawing: RewardDrawing) -> str:
    """The page's HTML. Its policy admits only the style and the script written here, by their hashes."""
    shown = [one for each in drawing.rounds for one in each.trained]
    curves = [*shown, *([drawing.winner] if drawing.winner else [])]
    laps = [point.lap_s for one in curves for point in one.curve if point.lap_s is not None]
    bounds = (min(laps), max(laps)) if laps else None
    return render_page(
        "reward/page.html",
        player_style() + template_text("scroll.css", "reward/page.css"),
        "reward/page.js",
        drawing=drawing,
        names=list(drawing.clips),
        starts=max(map(len, drawing.clips.values()), default=0),
        drawn=lambda one: curve_lines(one.curve, bounds),
        size=CURVE,
        bounds=bounds,
        data=script_data({"circuit": drawing.circuit, "clips": drawing.clips, "car": drawing.car}),
    )


def curve_lines(curve: Sequence[CurvePoint], bounds: tuple[float, float] | None) -> dict[str, str]:
    """Laps and time off course of a training as the points of two polylines, in a box of the size `CURVE`.

    Args:
        curve: checkpoints.
        bounds: fastest and slowest lap of the page, None if there is none; the fastest is at the bottom, as
            is no time off course.
    """
    width, height = CURVE
    last = max((point.updates for point in curve), default=1)

    def at(updates: int, share: float) -> str:
        x = MARGIN + (width - 2 * MARGIN) * updates / last
        return f"{x:.1f},{height - MARGIN - (height - 2 * MARGIN) * min(max(share, 0.0), 1.0):.1f}"

    low, high = bounds or (0.0, 1.0)
    span = max(high - low, 1e-9)
    return {
        "laps": " ".join(at(one.updates, (one.lap_s - low) / span) for one in curve if one.lap_s is not None),
        "off_course": " ".join(at(one.updates, one.off_course) for one in curve),
        "told": ", ".join(
            f"{one.updates:,} updates: " + (f"{one.lap_s:.1f} s" if one.lap_s is not None else "no lap")
            for one in curve
        ),
    }
