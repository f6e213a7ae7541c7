"""Why time is lost in a part of a lap: what the driver does otherwise than the one of the other lap."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from nathlon.lab.coach.lap import STEP_M, Lap
from nathlon.lab.coach.parts import FULL, CoursePart, PartMarks, smooth
from nathlon.lab.coach.shares import shares, turn
from nathlon.results.coach import Cause, CauseKind

EARLY_M = 5.0
"""Braking or throttle that differs by less is the same."""
SLOWER_M_S = 0.4
"""So is a speed,"""
ASIDE_M = 1.0
"""and so is a line, """
BEGINS_ASIDE_M = 0.5
"""and one before the braking."""
SOONER_M = 10.0
"""Whose slowest place lies so much before that of the other has slowed down early."""
PUSHING = 0.85
"""Throttle of both from which it is not the foot that makes the difference,"""
WEAKER_M_S2 = 0.6
"""and how much less a car must gain for it to be for want of traction."""
LIFTED = 0.02
"""Share of the throttle less, in the mean of where the other has it full on a straight,"""
NOT_FULL = 0.04
"""and from which on it is worth trying to give more."""
OF_SPEED = (
    "braking_early", "braking_late", "entry_speed", "minimum_speed", "throttle", "traction", "exit_speed",
    "lifting", "standing_start",
)  # fmt: skip
"""Causes that say why a driver is slower somewhere."""
TOO_LATE = ("braking_late", "entry_speed")
"""Causes of which a mishap may come."""
MIN_LOSS_S = 0.02
"""What is less needs no cause."""


class ComparedParts(NamedTuple):
    """A part of the coached lap beside the same part of the other one.

    Attributes:
        own, other: the laps.
        part: the part.
        marks: of each in a bend; None on a straight.
        everywhere: whether the coached driver is slower all over the lap.
    """

    own: Lap
    other: Lap
    part: CoursePart
    marks: tuple[PartMarks, PartMarks] | None
    everywhere: bool = False

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

    @property
    def throttle(self) -> tuple[float, float]:
        """Throttle in the mean, of the own lap and the other one, of where that one has it full."""
        inside = slice(self.own.at(self.part.start_m), self.own.at(self.part.end_m) + 1)
        full = smooth(self.other.pedal)[inside] >= FULL
        if not full.any():
            full[:] = True
        own, other = (
            float(np.clip(lap.pedal[inside][full], 0.0, 1.0).mean()) for lap in (self.own, self.other)
        )
        return own, other

    @property
    def improvable(self) -> bool:
        """Whether there are other ways to drive the part: on a straight where the throttle is not full."""
        inside = slice(self.own.at(self.part.start_m), self.own.at(self.part.end_m) + 1)
        return self.part.bend or float(np.clip(self.own.pedal[inside], 0.0, 1.0).mean()) < 1.0 - NOT_FULL

    def cause(
        self,
        kind: CauseKind,
        at_m: float,
        own: float | None = None,
        other: float | None = None,
        unit: str = "",
        lost_s: float | None = None,
    ) -> Cause:
        """A cause at a place, with what it explains of the loss."""
        return Cause(
            kind=kind,
            own=None if own is None else round(own, 2),
            other=None if other is None else round(other, 2),
            unit=unit,
            at_m=round(at_m, 1),
            at_s=round(self.own.start_s + float(self.own.time_s[self.own.at(at_m)]), 2),
            lost_s=None if lost_s is None else round(lost_s, 3),
        )


def causes_of(compared: ComparedParts) -> list[Cause]:
    """Why time is lost in a part, as far as one lap alone tells; others cars and stewards apart.

    Those come first that explain most of the loss, see `nathlon.lab.coach.shares`; a mishap comes before
    them, but after what brought it about: braking late, and coming too fast.
    """
    found: list[Cause] = []
    if compared.lost_s >= MIN_LOSS_S:
        marks = compared.marks
        found += _on_straight(compared) if marks is None else _in_bend(compared, *marks)
        if not any(cause.kind in OF_SPEED for cause in found):
            found += _slower(compared)
        found.sort(key=lambda cause: -(cause.lost_s or 0.0))
    mishaps = list(_mishaps(compared))
    brought = [cause for cause in found if mishaps and cause.kind in TOO_LATE]
    return [*brought, *mishaps, *(cause for cause in found if cause not in brought)]


def _in_bend(compared: ComparedParts, does: PartMarks, shows: PartMarks) -> Iterator[Cause]:
    own, other, part = compared.own, compared.other, compared.part
    middle = compared.middle_m
    lost = shares(own, other, part.start_m, shows.apex_m, part.end_m)
    slower = shows.least_m_s - does.least_m_s > SLOWER_M_S
    ahead = 0.0
    if does.brake_m is not None and shows.brake_m is not None and middle is not None:
        ahead = shows.brake_m - does.brake_m
    begins_m = min((mark.brake_m for mark in (does, shows) if mark.brake_m is not None), default=part.start_m)
    # Who begins the bend elsewhere on the road drives another line; later that may follow from the speed.
    way_in = slice(own.at(part.start_m), own.at(begins_m) + 1)
    begins_aside = bool((np.abs(own.lateral[way_in] - other.lateral[way_in]) > BEGINS_ASIDE_M).any())
    turns = turn(own, other, part.start_m, part.end_m)
    narrower = begins_aside and turns.narrower
    faster_m = None if narrower else _too_fast(compared, shows.apex_m)
    too_fast = faster_m is not None
    # Who has slowed down long before the slowest place of the other has braked early, wherever it began.
    slows_early = middle is not None and shows.apex_m - does.apex_m > SOONER_M
    early = (ahead > EARLY_M or slows_early) and compared.lost(part.start_m, shows.apex_m) > 0.0
    if early:
        # Who brakes too early is slower than its way asks for; who trusts its grip less is slow everywhere.
        hasty = turns.tighter and not (compared.everywhere or narrower)
        begins = (does.brake_m, shows.brake_m) if ahead > EARLY_M else (does.apex_m, shows.apex_m)
        at_m = does.brake_m or part.start_m
        explains = lost.before + (lost.carried if hasty else 0.0)
        yield compared.cause("braking_early", at_m, *begins, "m", explains)
    else:
        hasty = False
    of_entry = lost.way + lost.carried + lost.after + min(lost.before, 0.0)
    if faster_m is not None and ahead < -EARLY_M:
        at_m = does.brake_m or part.start_m
        yield compared.cause("braking_late", at_m, does.brake_m, shows.brake_m, "m", of_entry)
    elif faster_m is not None:
        at = own.at(faster_m)
        speeds = 3.6 * float(own.speed[at]), 3.6 * float(other.speed[at])
        yield compared.cause("entry_speed", faster_m, *speeds, "km/h", of_entry)
    if slower:
        speeds = 3.6 * does.least_m_s, 3.6 * shows.least_m_s
        follows = hasty or too_fast or narrower
        yield compared.cause("minimum_speed", does.apex_m, *speeds, "km/h", 0.0 if follows else lost.carried)
    if not too_fast:
        yield from _line(compared, of_entry if narrower else lost.way)
    if middle is not None and compared.lost(middle, part.end_m) > 0.0:
        after = 0.0 if too_fast or narrower else lost.after
        if does.full_m is not None and shows.full_m is not None and does.full_m - shows.full_m > EARLY_M:
            yield compared.cause("throttle", does.full_m, does.full_m, shows.full_m, "m", after)
        yield from _traction(compared, middle, after)


def _too_fast(compared: ComparedParts, slowest_m: float) -> float | None:
    """Where a driver is faster on the way into a bend, but slower on the way out of it; None if it is not."""
    own, other, part = compared.own, compared.other, compared.part
    inside = slice(own.at(part.start_m), own.at(slowest_m))
    faster = own.speed[inside] - other.speed[inside]
    if not len(faster) or compared.lost(slowest_m, part.end_m) <= 0.0:
        return None
    at = int(np.argmax(faster))
    return (inside.start + at) * STEP_M if faster[at] > SLOWER_M_S else None


def _slower(compared: ComparedParts) -> Iterator[Cause]:
    """Where a part that has no other cause is slowest beside the other lap."""
    own, other, part = compared.own, compared.other, compared.part
    inside = slice(own.at(part.start_m), own.at(part.end_m) + 1)
    at = inside.start + int(np.argmax(other.speed[inside] - own.speed[inside]))
    if other.speed[at] - own.speed[at] > SLOWER_M_S:
        lost = shares(own, other, part.start_m, at * STEP_M, part.end_m)
        speeds = 3.6 * float(own.speed[at]), 3.6 * float(other.speed[at])
        yield compared.cause("speed", at * STEP_M, *speeds, "km/h", lost.carried)


def _line(compared: ComparedParts, lost_s: float) -> Iterator[Cause]:
    """A line that costs time: one that does not is another line and no cause."""
    own, other, part = compared.own, compared.other, compared.part
    inside = slice(own.at(part.start_m), own.at(part.end_m) + 1)
    aside = own.lateral[inside] - other.lateral[inside]
    at = int(np.argmax(np.abs(aside)))
    if abs(aside[at]) > ASIDE_M and lost_s >= MIN_LOSS_S:
        place = inside.start + at
        sides = float(own.lateral[place]), float(other.lateral[place])
        yield compared.cause("line", place * STEP_M, *sides, "m left", lost_s)


def _traction(compared: ComparedParts, middle_m: float, lost_s: float) -> Iterator[Cause]:
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
        yield compared.cause("traction", first, float(gained[0]), float(gained[1]), "m/s²", lost_s)


def _on_straight(compared: ComparedParts) -> Iterator[Cause]:
    own, other, part = compared.own, compared.other, compared.part
    first = own.at(part.start_m)
    inside = slice(first, own.at(part.end_m) + 1)
    if own.standing and part.start_m == 0.0:
        yield compared.cause("standing_start", 0.0)
        return
    lost = shares(own, other, part.start_m, part.start_m, part.end_m)
    if other.speed[first] - own.speed[first] > SLOWER_M_S:
        speeds = 3.6 * float(own.speed[first]), 3.6 * float(other.speed[first])
        yield compared.cause("exit_speed", part.start_m, *speeds, "km/h", lost.carried)
    pushed = compared.throttle
    if pushed[1] - pushed[0] > LIFTED:
        lifted = inside.start + int(np.argmin(smooth(own.pedal)[inside]))
        shown = 100.0 * pushed[0], 100.0 * pushed[1]
        yield compared.cause("lifting", lifted * STEP_M, *shown, "%", lost.after)


def _mishaps(compared: ComparedParts) -> Iterator[Cause]:
    own, part = compared.own, compared.part
    inside = slice(own.at(part.start_m), own.at(part.end_m))
    flags: tuple[tuple[CauseKind, np.ndarray], ...] = (
        ("off_course", own.off_course[inside]),
        ("wall", own.wall_contact[inside]),
    )
    for kind, flag in flags:
        if flag.any():
            yield compared.cause(kind, (inside.start + int(np.argmax(flag))) * STEP_M)
