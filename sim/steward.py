"""The stewards: what they make of excursions and contacts, and how penalties are served."""

from __future__ import annotations

import math
from typing import NamedTuple

from nathlon.sim.kernel import lean_inlined
from nathlon.sim.physics.body import speed_squared
from nathlon.sim.physics.contact import Touch
from nathlon.sim.physics.course import CourseParameters, facing
from nathlon.sim.rules import RuleParameters
from nathlon.sim.state import OTHER, REAR_END, SIDE_SWIPE, CarRecord, Cars, ContactRecord
from nathlon.sim.track import SECTION, TANGENT_X, TANGENT_Y, ZONE

SAME_WAY = 0.5
"""Cosine of the angle between two headings from which cars count as going the same way."""
END_ON = 0.7
"""Cosine of the angle between normal and heading from which a contact is one of front and tail."""
SLOWING = 0.35
"""Share of the brakes with which a car is slowed for each m/s that it is too fast."""


class Approach(NamedTuple):
    """How two cars came together.

    Attributes:
        relative_x, relative_y: velocity of the second car less that of the first, world frame, m/s.
        faster: index of the car that was faster.
    """

    relative_x: float
    relative_y: float
    faster: int


@lean_inlined
def penalise(car: CarRecord, seconds: float) -> None:
    """Give a car a penalty."""
    if seconds > 0.0:
        car.penalties += 1
        car.penalty_s += seconds


@lean_inlined
def watch_limits(car: CarRecord, off: bool, now: float, dt: float, rules: RuleParameters) -> None:
    """Follow a car's excursion off the course, and judge it at its end.

    An excursion has cut a corner if it gained more of the centre line than the way that was driven.
    It is excused if it began soon after a touch with another car.

    Args:
        off: whether the car is off course.
        now: s since the start.
    """
    if off:
        if car.out_s == 0.0:
            car.out_excused = now - car.contact_s < rules.excused
            car.out_from = car.progress
            car.out_path = 0.0
        car.out_s += dt
        car.out_path += dt * math.sqrt(speed_squared(car))
        return
    if car.out_s == 0.0:
        return
    lasted = car.out_s
    car.out_s = 0.0
    if lasted < rules.shortest or car.out_excused:
        return
    if car.progress - car.out_from - car.out_path > rules.cut_gain:
        penalise(car, rules.cut_penalty)
        return
    car.warnings += 1
    if car.warnings > rules.warnings:
        penalise(car, rules.limits_penalty)


@lean_inlined
def serve_penalty(car: CarRecord, dt: float, course: CourseParameters, rules: RuleParameters) -> None:
    """Hold a penalised car to the speed of the penalty zones; time spent so is served."""
    if car.penalty_s <= 0.0 or course.table[car.row, ZONE] == 0.0:
        return
    above = car.velocity_x - rules.serving_speed
    if above > -1.0:
        car.throttle = 0.0
        car.brake = max(car.brake, min(SLOWING * above, 1.0))
    if above < 1.0:
        car.penalty_s = max(car.penalty_s - dt, 0.0)


@lean_inlined
def across(car: CarRecord, course: CourseParameters) -> float:
    """Speed of a car to the left across the road beside it, m/s."""
    sine, cosine = facing(car, course)
    return car.velocity_x * sine + car.velocity_y * cosine


@lean_inlined
def judge(
    behind: CarRecord,
    ahead: CarRecord,
    touch: Touch,
    course: CourseParameters,
    rules: RuleParameters,
) -> tuple[int, int]:
    """The geometry of a contact and who is to blame: 0 for the car behind, 1 for the other, -1 for nobody.

    Cars that go the same way and meet front to tail: the one behind. Side by side: the one that
    came closer to the other across the road, if it did so clearly faster. Anything else: nobody.

    Args:
        touch: with the normal from the car behind to the car ahead.
    """
    same_way = behind.cos_yaw * ahead.cos_yaw + behind.sin_yaw * ahead.sin_yaw > SAME_WAY
    if not same_way:
        return OTHER, -1
    if abs(touch.normal_x * ahead.cos_yaw + touch.normal_y * ahead.sin_yaw) > END_ON:
        return REAR_END, 0 if touch.closing > rules.light else -1
    if touch.closing <= rules.light:
        return SIDE_SWIPE, -1
    # Each car's approach across the road counts against the other's. What decides is thus the sum
    # of their speeds to one side, which the impulses between them have not changed.
    line = course.table[ahead.row]
    side = 1.0 if touch.normal_y * line[TANGENT_X] - touch.normal_x * line[TANGENT_Y] > 0.0 else -1.0
    drift = across(behind, course) + across(ahead, course)
    if side * drift > rules.clear:
        return SIDE_SWIPE, 0
    if side * drift < -rules.clear:
        return SIDE_SWIPE, 1
    return SIDE_SWIPE, -1


@lean_inlined
def note_contact(
    cars: Cars,
    i: int,
    j: int,
    touch: Touch,
    approach: Approach,
    now: float,
    note: ContactRecord,
    course: CourseParameters,
    rules: RuleParameters,
) -> None:
    """Fill in the note of a contact that began, and give the penalty for it.

    Args:
        cars: of the race.
        i, j: indices of the two; `touch` has its normal from i to j.
        approach: of j to i.
        now: s since the start.
        note: a CONTACT record.
    """
    gap = cars[j].progress - cars[i].progress
    gap -= math.floor(gap / course.length + 0.5) * course.length
    behind, ahead = i, j
    relative_x, relative_y = approach.relative_x, approach.relative_y
    if gap < 0.0:
        behind, ahead = j, i
        touch = Touch(touch.closing, touch.x, touch.y, -touch.normal_x, -touch.normal_y)
    else:
        relative_x, relative_y = -relative_x, -relative_y
    a, b = cars[behind], cars[ahead]
    geometry, fault = judge(a, b, touch, course, rules)
    note.time = now
    note.behind = behind
    note.ahead = ahead
    note.x = touch.x
    note.y = touch.y
    note.closing = touch.closing
    note.relative_x = relative_x * b.cos_yaw + relative_y * b.sin_yaw
    note.relative_y = relative_y * b.cos_yaw - relative_x * b.sin_yaw
    note.geometry = geometry
    note.faster = approach.faster
    note.section_behind = int(course.table[a.row, SECTION])
    note.section_ahead = int(course.table[b.row, SECTION])
    note.fault = -1
    note.penalty_s = 0.0
    a.contacts += 1
    b.contacts += 1
    if approach.faster == behind:
        a.contacts_faster_behind += 1
    if fault < 0:
        return
    guilty = behind if fault == 0 else ahead
    seconds = rules.rear_end_penalty if geometry == REAR_END else rules.side_swipe_penalty
    if touch.closing > rules.heavy:
        seconds *= 2.0
    note.fault = guilty
    note.penalty_s = seconds
    cars[guilty].contacts_at_fault += 1
    penalise(cars[guilty], seconds)
