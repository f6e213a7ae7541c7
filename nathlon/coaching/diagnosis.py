"""Why time is lost in a part of a lap: what the driver does otherwise than the one of the other lap."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from nathlon.coaching.lap import STEP_M, Lap
from nathlon.coaching.parts import Marks, Part, smooth
from nathlon.reports.coach import Cause, CauseKind

EARLY_M = 5.0
"""Braking or throttle that differs by less is the same."""
SLOWER_M_S = 0.4
"""So is a speed,"""
ASIDE_M = 1.0
"""and so is a line."""
PUSHING = 0.85
"""Throttle of both from which it is not the foot that makes the difference,"""
WEAKER_M_S2 = 0.6
"""and how much less a car must gain for it to be for want of traction."""
LIFTED = 0.04
"""Share of the throttle less, in the mean of a straight."""
MIN_LOSS_S = 0.02
"""What is less needs no cause."""


class Compared(NamedTuple):
    """A part of the coached lap beside the same part of the other one.

    Attributes:
        own, other: the laps.
        part: the part.
        marks: of each in a bend; None on a straight.
    """

    own: Lap
    other: Lap
    part: Part
    marks: tuple[Marks, Marks] | None

    def lost(self, start_m: float, end_m: float) -> float:
        """Time lost between two places, s."""
        return self.own.between(start_m, end_m) - self.other.between(start_m, end_m)

    @property
    def lost_s(self) -> float:
        """Time lost in the part, s."""
        return self.lost(self.part.start_m, self.part.end_m)

    @property
    def middle_m(self) -> float | None:
        """The slowest place of a bend; None on a straight, and where it is at either end."""
        if self.marks is None:
            return None
        middle = 0.5 * sum(mark.apex_m for mark in self.marks)
        inside = self.part.start_m + EARLY_M < middle < self.part.end_m - EARLY_M
        return middle if inside else None

    def cause(
        self,
        kind: CauseKind,
        at_m: float,
        own: float | None = None,
        other: float | None = None,
        unit: str = "",
    ) -> Cause:
        """A cause at a place."""
        return Cause(
            kind=kind,
            own=None if own is None else round(own, 2),
            other=None if other is None else round(other, 2),
            unit=unit,
            at_m=round(at_m, 1),
            at_s=round(self.own.start_s + float(self.own.time_s[self.own.at(at_m)]), 2),
        )


def causes_of(compared: Compared) -> list[Cause]:
    """Why time is lost in a part, as far as one lap alone tells; others cars and stewards apart."""
    found = list(_mishaps(compared))
    if compared.lost_s >= MIN_LOSS_S:
        marks = compared.marks
        found += _on_straight(compared) if marks is None else _in_bend(compared, *marks)
        if not found:
            found += _slower(compared)
    return found


def _in_bend(compared: Compared, does: Marks, shows: Marks) -> Iterator[Cause]:
    middle = compared.middle_m
    slower = middle is not None and shows.least_m_s - does.least_m_s > SLOWER_M_S
    end = compared.part.end_m
    if does.brake_m is not None and shows.brake_m is not None and middle is not None:
        ahead = shows.brake_m - does.brake_m
        if ahead > EARLY_M and compared.lost(compared.part.start_m, middle) > 0.0:
            yield compared.cause("braking_early", does.brake_m, does.brake_m, shows.brake_m, "m")
        if ahead < -EARLY_M and (slower or compared.lost(middle, end) > 0.0):
            yield compared.cause("braking_late", does.brake_m, does.brake_m, shows.brake_m, "m")
    if slower:
        yield compared.cause(
            "minimum_speed", does.apex_m, 3.6 * does.least_m_s, 3.6 * shows.least_m_s, "km/h"
        )
    yield from _line(compared)
    if middle is not None and compared.lost(middle, end) > 0.0:
        if does.full_m is not None and shows.full_m is not None and does.full_m - shows.full_m > EARLY_M:
            yield compared.cause("throttle", does.full_m, does.full_m, shows.full_m, "m")
        yield from _traction(compared, middle)


def _slower(compared: Compared) -> Iterator[Cause]:
    """Where a part that has no other cause is slowest beside the other lap."""
    own, other, part = compared.own, compared.other, compared.part
    inside = slice(own.at(part.start_m), own.at(part.end_m) + 1)
    at = inside.start + int(np.argmax(other.speed[inside] - own.speed[inside]))
    if other.speed[at] - own.speed[at] > SLOWER_M_S:
        yield compared.cause(
            "speed", at * STEP_M, 3.6 * float(own.speed[at]), 3.6 * float(other.speed[at]), "km/h"
        )


def _line(compared: Compared) -> Iterator[Cause]:
    own, other, part = compared.own, compared.other, compared.part
    inside = slice(own.at(part.start_m), own.at(part.end_m) + 1)
    aside = own.lateral[inside] - other.lateral[inside]
    at = int(np.argmax(np.abs(aside)))
    if abs(aside[at]) > ASIDE_M:
        place = inside.start + at
        yield compared.cause(
            "line", place * STEP_M, float(own.lateral[place]), float(other.lateral[place]), "m left"
        )


def _traction(compared: Compared, middle_m: float) -> Iterator[Cause]:
    """Where both push on the way out and the car gains less speed."""
    own, other = compared.own, compared.other
    inside = slice(own.at(middle_m), own.at(compared.part.end_m) + 1)
    pushing = (smooth(own.pedal)[inside] > PUSHING) & (smooth(other.pedal)[inside] > PUSHING)
    if pushing.sum() * STEP_M < 2.0 * EARLY_M:
        return
    gained = own.acceleration[inside][pushing].mean(), other.acceleration[inside][pushing].mean()
    # A faster car gains less by power alone.
    as_fast = own.speed[inside][pushing].mean() <= other.speed[inside][pushing].mean() + SLOWER_M_S
    if gained[1] - gained[0] > WEAKER_M_S2 and as_fast:
        first = (inside.start + int(np.argmax(pushing))) * STEP_M
        yield compared.cause("traction", first, float(gained[0]), float(gained[1]), "m/s²")


def _on_straight(compared: Compared) -> Iterator[Cause]:
    own, other, part = compared.own, compared.other, compared.part
    first = own.at(part.start_m)
    inside = slice(first, own.at(part.end_m) + 1)
    if own.standing and part.start_m == 0.0:
        yield compared.cause("standing_start", 0.0)
        return
    if other.speed[first] - own.speed[first] > SLOWER_M_S:
        yield compared.cause(
            "exit_speed", part.start_m, 3.6 * float(own.speed[first]), 3.6 * float(other.speed[first]), "km/h"
        )
    pushed = [float(np.clip(lap.pedal[inside], 0.0, 1.0).mean()) for lap in (own, other)]
    if pushed[1] - pushed[0] > LIFTED:
        lifted = inside.start + int(np.argmin(smooth(own.pedal)[inside]))
        yield compared.cause("lifting", lifted * STEP_M, 100.0 * pushed[0], 100.0 * pushed[1], "%")


def _mishaps(compared: Compared) -> Iterator[Cause]:
    own, part = compared.own, compared.part
    inside = slice(own.at(part.start_m), own.at(part.end_m))
    flags: tuple[tuple[CauseKind, np.ndarray], ...] = (
        ("off_course", own.off_course[inside]),
        ("wall", own.wall_contact[inside]),
    )
    for kind, flag in flags:
        if flag.any():
            yield compared.cause(kind, (inside.start + int(np.argmax(flag))) * STEP_M)
