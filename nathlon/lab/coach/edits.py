"""Edits of how a part of a lap is driven: what the coach tries before it gives an advice."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from nathlon.lab.coach.driving import TrialPlan
from nathlon.lab.coach.lap import STEP_M, Lap, Trace
from nathlon.lab.coach.parts import CoursePart, PartMarks
from nathlon.results.coach import AdviceKind

LATER_M = (2.0, 4.0, 7.0, 11.0, 16.0, 22.0, 32.0, 48.0, 70.0)
EARLIER_M = (4.0, 8.0)
FASTER = (0.005, 0.01, 0.02, 0.035, 0.05, 0.08, 0.12, 0.18)
"""Shares by which the speed in the bend is raised."""
SOONER_M = (4.0, 8.0, 14.0, 22.0, 35.0, 55.0)
CLOSER = (0.25, 0.5, 0.75, 1.0)
"""Shares of the way from the own line to the other one."""
LIFTS_M = (0.0, 25.0, 60.0, 120.0)
"""Before the end of a straight, where full throttle ends."""
BLEND_M = 60.0
"""Before and after a bend, over which one line becomes the other."""
LEAST_M = 8.0
"""A braking or a way to full throttle that would be shorter is left as it is."""


@dataclass(frozen=True)
class Edit:
    """One way to drive a part otherwise.

    Attributes:
        kind: what is done.
        amount: m, share of the speed, of the way to the other line, or of the throttle.
        plan: with the edit.
    """

    kind: AdviceKind
    amount: float
    plan: TrialPlan


def edits_of(part: CoursePart, own: Lap, other: Lap, does: PartMarks, shows: PartMarks) -> Iterator[Edit]:
    """The edits that are tried in a bend.

    Args:
        part: the bend.
        own: the lap that is coached.
        other: the lap that it is compared with.
        does, shows: what each does in the bend.
    """
    plan = TrialPlan.of(own)
    ends_m = does.full_m if does.full_m is not None else part.end_m
    if does.brake_m is not None:
        begin = does.brake_m
        for metres in LATER_M:
            if does.apex_m - begin - metres >= LEAST_M:
                yield Edit("brake_later", metres, _brake_at(plan, begin, begin + metres, does.apex_m))
        for metres in EARLIER_M:
            if begin - metres >= 0.0:
                earlier = _brake_at(plan, begin, begin - metres, does.apex_m)
                for share in FASTER:
                    faster = _faster(earlier, begin - metres, does.apex_m, ends_m, share)
                    yield Edit("brake_earlier", metres, faster)
    enters_m = does.brake_m if does.brake_m is not None else part.start_m
    for share in FASTER:
        yield Edit("more_speed", share, _faster(plan, enters_m, does.apex_m, ends_m, share))
    for metres in SOONER_M:
        if does.full_m is not None and does.full_m - metres - does.apex_m >= LEAST_M:
            yield Edit("throttle_earlier", metres, _full_at(plan, does.apex_m, does.full_m, metres))
    leaves_m = max(ends_m, shows.full_m or part.end_m)
    for share in CLOSER:
        yield Edit("line", share, _towards(plan, TrialPlan.of(other), part.start_m, leaves_m, share))


def full_throttle(part: CoursePart, own: Lap) -> Iterator[Edit]:
    """The edits that are tried on a straight: the throttle is full until somewhere before its end."""
    plan = TrialPlan.of(own)
    at = _places(plan)
    for metres in LIFTS_M:
        inside = (at >= part.start_m) & (at <= part.end_m - metres)
        more = np.where(inside, np.maximum(1.0 - plan.pedal, 0.0), 0.0)
        if more.any():
            share = float(more[(at >= part.start_m) & (at <= part.end_m)].mean())
            yield Edit("full_throttle", share, plan.with_traces(pedal=plan.pedal + more))


def _places(plan: TrialPlan) -> Trace:
    return np.arange(len(plan.pedal)).astype(np.float64) * STEP_M


def _brake_at(plan: TrialPlan, before_m: float, begin_m: float, apex_m: float) -> TrialPlan:
    """Brake from another place on, so much harder or softer that the speed at the apex is the same."""
    at = _places(plan)
    harder = (apex_m - before_m) / (apex_m - begin_m)
    from_m = min(before_m, begin_m)
    inside = (at >= begin_m) & (at <= apex_m)
    as_at = np.where(inside, before_m + (at - begin_m) * harder, at)
    pedal, speed = np.interp(as_at, at, plan.pedal), np.interp(as_at, at, plan.speed)
    pedal = np.where(inside & (pedal < 0.0), np.clip(pedal * harder, -1.0, 0.0), pedal)
    held = plan.pedal[max(round((before_m - 2 * STEP_M) / STEP_M), 0)]
    pedal = np.where((at >= from_m) & (at < begin_m), held, pedal)
    return plan.with_traces(pedal=pedal, speed=speed)


def _faster(plan: TrialPlan, enters_m: float, apex_m: float, leaves_m: float, share: float) -> TrialPlan:
    """Raise the speed by a share at the apex, by less towards both ends."""
    at = _places(plan)
    bump = np.interp(
        at, [enters_m, max(apex_m, enters_m + STEP_M), max(leaves_m, apex_m + LEAST_M)], [0, 1, 0]
    )
    return plan.with_traces(speed=plan.speed * (1.0 + share * bump))


def _full_at(plan: TrialPlan, apex_m: float, full_m: float, metres: float) -> TrialPlan:
    """Be at full throttle some metres earlier, and press it so much faster."""
    at = _places(plan)
    earlier = full_m - metres
    inside = (at >= apex_m) & (at <= earlier)
    as_at = np.where(inside, apex_m + (at - apex_m) * (full_m - apex_m) / (earlier - apex_m), at)
    pedal = np.where((at > earlier) & (at <= full_m), 1.0, np.interp(as_at, at, plan.pedal))
    return plan.with_traces(pedal=pedal, speed=np.interp(as_at, at, plan.speed))


def _towards(plan: TrialPlan, other: TrialPlan, start_m: float, leaves_m: float, share: float) -> TrialPlan:
    """Drive a part of the lap on the way of another lap, as it does, or between the two."""
    at = _places(plan)
    weight = np.interp(
        at, [start_m - BLEND_M, start_m, leaves_m, leaves_m + BLEND_M], [0.0, share, share, 0.0]
    )
    traces = {
        name: (1.0 - weight) * getattr(plan, name) + weight * getattr(other, name)
        for name in TrialPlan.__dataclass_fields__
    }
    return plan.with_traces(**traces)
