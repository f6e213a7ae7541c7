"""Proving an advice: the part is driven again with the edit and without it, from the same starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nathlon.lab.coach.driving import HANDS, DrivenTrial, Hands, Jolt, Rider, TrialPlan
from nathlon.lab.coach.edits import Edit
from nathlon.lab.coach.lap import Lap
from nathlon.lab.coach.parts import CoursePart

STARTS = (Jolt(), Jolt(speed=0.3), Jolt(speed=-0.3), Jolt(lateral=0.15), Jolt(lateral=-0.15))
"""As recorded, and a little off: what gains by the luck of one number is no advice."""
RUN_UP_M = 120.0
"""Before a part, from where it is driven: the line of another lap is reached on the way."""
TRUE_S = 0.06
"""By how much a part that is driven again without an edit may differ from the recording."""
WELL_S = 0.02
"""A rider that differs by less needs no other hands."""
LEAST_GAIN_S = 0.02
"""What is less is no advice."""


@dataclass(frozen=True)
class ProofWindow:
    """What is driven for a part, m from the line.

    Attributes:
        start_m: from where.
        section_m: where the part ends.
        end_m: where the straight or bend after it ends; the line at the latest.
    """

    start_m: float
    section_m: float
    end_m: float


@dataclass(frozen=True)
class Proved:
    """An edit that gains.

    Attributes:
        edit: what is done otherwise.
        gain_s: the least that it gains until the end of the window, over all starts, s.
        section_gain_s: gains until the end of the section, from the recorded start, s.
        recorded_s, again_s, edited_s: the window as recorded, driven again, and with the edit, s.
        starts: from how many starts it was driven.
        again, edited: these drives from the recorded start.
    """

    edit: Edit
    gain_s: float
    section_gain_s: float
    recorded_s: float
    again_s: float
    edited_s: float
    starts: int
    again: DrivenTrial
    edited: DrivenTrial


@dataclass(frozen=True)
class ProofTrial:
    """What came of all edits of a part.

    Attributes:
        window: that was driven.
        tried: how many edits there were.
        best: the best of each kind that gains, the greatest gain first.
        untrue: why nothing could be proved; empty where it could.
    """

    window: ProofWindow
    tried: int
    best: tuple[Proved, ...]
    untrue: str = ""


def window_of(parts: Sequence[CoursePart], part: CoursePart, length_m: float) -> ProofWindow:
    """What is driven for a bend: from before it to the end of the straight or the bend that follows."""
    last = part.number + 1 == len(parts)
    return ProofWindow(
        max(part.start_m - RUN_UP_M, 0.0), part.end_m, length_m if last else parts[part.number + 1].end_m
    )


def try_edits(rider: Rider, lap: Lap, window: ProofWindow, edits: Sequence[Edit]) -> ProofTrial:
    """Drive a window with each edit and without, and keep what gains.

    An edit gains if from every start it is faster than without it from the same one, and from the recorded
    start faster than the recording; and if it stays on course.
    """
    own, span = TrialPlan.of(lap), (window.start_m, window.end_m)
    recorded_s = lap.between(*span)
    hands, again = _repeat(rider, own, span, recorded_s)
    off_s = abs(again[0].until(window.end_m) - recorded_s)
    if not all(drive.clean and drive.places[-1] >= window.end_m for drive in again):
        return ProofTrial(window, len(edits), (), "driven again it does not stay on course")
    if off_s > TRUE_S:
        return ProofTrial(window, len(edits), (), f"driven again it takes {off_s:.2f} s more or less")
    driven = rider.drive([(edit.plan, jolt) for edit in edits for jolt in STARTS], *span, hands)
    rows = [driven[first : first + len(STARTS)] for first in range(0, len(driven), len(STARTS))]
    found = [_proved(edit, window, recorded_s, again, row) for edit, row in zip(edits, rows, strict=True)]
    best: dict[str, Proved] = {}
    for one in found:
        if one is not None and (one.edit.kind not in best or one.gain_s > best[one.edit.kind].gain_s):
            best[one.edit.kind] = one
    return ProofTrial(window, len(edits), tuple(sorted(best.values(), key=lambda one: -one.gain_s)))


def _repeat(
    rider: Rider, own: TrialPlan, span: tuple[float, float], recorded_s: float
) -> tuple[Hands, list[DrivenTrial]]:
    """The first hands that repeat a window well, else those that do best, and how they do from all starts."""
    found: list[tuple[tuple[int, float], Hands, list[DrivenTrial]]] = []
    for hands in HANDS:
        drives = rider.drive([(own, jolt) for jolt in STARTS], *span, hands)
        astray = sum(not drive.clean or drive.places[-1] < span[1] for drive in drives)
        found.append(((astray, abs(drives[0].until(span[1]) - recorded_s)), hands, drives))
        if not astray and found[-1][0][1] < WELL_S:
            break
    _, hands, drives = min(found, key=lambda one: one[0])
    return hands, drives


def _proved(
    edit: Edit,
    window: ProofWindow,
    recorded_s: float,
    again: Sequence[DrivenTrial],
    row: Sequence[DrivenTrial],
) -> Proved | None:
    before, after = (np.array([drive.until(window.end_m) for drive in drives]) for drives in (again, row))
    again_s, edited_s = float(before[0]), float(after[0])
    gain_s = min(float((before - after).min()), recorded_s - edited_s)
    if gain_s < LEAST_GAIN_S or not all(drive.clean for drive in row):
        return None
    return Proved(
        edit,
        gain_s,
        again[0].until(window.section_m) - row[0].until(window.section_m),
        recorded_s,
        again_s,
        edited_s,
        len(row),
        again[0],
        row[0],
    )
