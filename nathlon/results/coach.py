"""What the coach has found in a recorded race: the JSON that it leaves, of which page and words are made."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from nathlon.results.part import ResultModel

CauseKind = Literal[
    "braking_early",
    "braking_late",
    "entry_speed",
    "minimum_speed",
    "speed",
    "line",
    "throttle",
    "traction",
    "exit_speed",
    "lifting",
    "standing_start",
    "traffic",
    "contact",
    "off_course",
    "wall",
    "penalty",
]
AdviceKind = Literal[
    "brake_later", "brake_earlier", "more_speed", "throttle_earlier", "line", "full_throttle"
]
Fault = Literal["own", "other", "nobody"]


class Cause(ResultModel):
    """Why time was lost in a section, with its evidence.

    Attributes:
        kind: what it is.
        own, other: what is compared, of the coached lap and the other one; None where there is nothing.
        unit: of both.
        at_m, at_s: where, m from the line, and when, s since the start of the race.
        car: name of another car that has to do with it.
        lost_s: what it explains of the time lost in the section, s; None where that is not known.
    """

    kind: CauseKind
    own: float | None = None
    other: float | None = None
    unit: str = ""
    at_m: float
    at_s: float
    car: str | None = None
    lost_s: float | None = None


class CoachedSection(ResultModel):
    """A part of the lap.

    Attributes:
        name, kind: of the circuit's section; corner, chicane or straight.
        start_m, end_m: m from the line; a bend begins where either driver brakes for it.
        time_s, other_s: of the coached lap and the other one.
        lost_s: the difference, negative where the coached lap is faster.
        entry_lost_s, exit_lost_s: of a bend, until its slowest place and from there on.
        spread_s: between the fastest and the slowest of the car's flying laps; None with fewer than two.
        causes: why.
    """

    name: str
    kind: str
    start_m: float
    end_m: float
    time_s: float
    other_s: float
    lost_s: float
    entry_lost_s: float | None = None
    exit_lost_s: float | None = None
    spread_s: float | None = None
    causes: tuple[Cause, ...] = ()


class Advice(ResultModel):
    """What is faster in a section, as it was driven again.

    Attributes:
        section: its name.
        number: of the section, from 0.
        kind: what to do.
        amount, unit: how much of it: m along the road, km/h in the bend, m across the road, or % throttle.
        share: of a line, %: of the way from how the car drove it to how the other lap does.
        side: to which the line is moved.
        at_m, at_s: where, m from the line, and when in the recorded race, s.
        from_m, until_m: of what was driven, m from the line.
        gain_s: the least that it gained by the end of the straight or bend that follows, over all starts.
        section_gain_s: what it gained by the end of the section, from the recorded start.
        recorded_s, again_s, edited_s: of what was driven: as recorded, again, and with the edit.
        starts: from how many starts it gained.
    """

    section: str
    number: int
    kind: AdviceKind
    amount: float
    unit: str
    share: float | None = None
    side: Literal["left", "right"] | None = None
    at_m: float
    at_s: float
    from_m: float
    until_m: float
    gain_s: float
    section_gain_s: float
    recorded_s: float
    again_s: float
    edited_s: float
    starts: int


class CoachedAttempt(ResultModel):
    """What was tried in a bend, or on a straight that was driven with less than full throttle.

    Attributes:
        section: its name.
        tried: edits that were driven.
        gained: those kinds of them that gained.
        unproved: why nothing could be proved; empty where it could.
    """

    section: str
    tried: int
    gained: int
    unproved: str = ""


class DrivenLap(ResultModel):
    """A lap of the car.

    Attributes:
        number: from 1.
        lap_s: its time.
        start_s: when it began, s since the start of the race.
        flying: whether it began at speed.
        off_course: whether the car left the course in it.
    """

    number: int
    lap_s: float
    start_s: float
    flying: bool
    off_course: bool


class Consistency(ResultModel):
    """How alike the flying laps are.

    Attributes:
        laps: how many there are.
        best_s, mean_s: of their times.
        deviation_s: standard deviation of their times.
        sum_of_best_s: the best time of each section together.
        least_steady: the section whose times differ most.
        least_steady_s: by how much.
    """

    laps: int
    best_s: float
    mean_s: float
    deviation_s: float
    sum_of_best_s: float
    least_steady: str
    least_steady_s: float


class Passing(ResultModel):
    """A pass by or of the car; see `nathlon.arena.passes`."""

    at_s: float
    by_car: bool
    car: str
    place: int
    section: str
    stands: bool


class Defence(ResultModel):
    """A time in which another car was close behind, and whether it came by."""

    from_s: float
    until_s: float
    car: str
    closest_m: float
    held: bool


class CoachedContact(ResultModel):
    """A contact of the car as the stewards saw it."""

    at_s: float
    car: str
    closing_m_s: float
    fault: Fault
    section: str
    text: str


class Mishap(ResultModel):
    """Something else that the stewards noted: wall, off_course, penalty, served."""

    at_s: float
    kind: str
    penalty_s: float
    text: str


class Craft(ResultModel):
    """The car among others."""

    passes: tuple[Passing, ...] = ()
    defences: tuple[Defence, ...] = ()
    contacts: tuple[CoachedContact, ...] = ()
    mishaps: tuple[Mishap, ...] = ()


class StartState(ResultModel):
    """A moment of the coached lap, from which a driver can begin; as `nathlon.sim.scenario_start.FrozenCar`.

    Attributes:
        section: before which it is.
        lost_s: what was lost there.
    """

    section: str
    lost_s: float
    progress_m: float
    lateral_m: float
    heading_rad: float
    speed_m_s: float
    side_speed_m_s: float
    yaw_rate_rad_s: float


class Raced(ResultModel):
    """Which race it was."""

    match: str
    race: int
    scenario: str
    circuit: str
    car: str
    version: str


class CoachedPace(ResultModel):
    """A car that is slower everywhere.

    Attributes:
        speed_share: of the other's speed, the median over the lap.
        slower_share: of the lap on which it is surely slower.
    """

    speed_share: float
    slower_share: float


class CoachFacts(ResultModel):
    """All that the coach knows.

    Attributes:
        format: of this file.
        raced: the race.
        car, name: number and name of the coached car.
        lap: the lap that is coached: the best one.
        laps: all that were completed.
        other, other_kind, other_lap_s: whose lap it is compared with.
        limit_s: the limit lap time; None where it is not known.
        lost_s: in the lap.
        pace: how much slower the car is everywhere; None where it is not.
        sections, consistency, craft: what was found.
        advice: what is fastest in a section, the greatest gain first.
        alternatives: what else gains in these sections.
        attempts: what was tried.
        together_s: what the lap gains with all advice at once, driven from line to line; None if it does not.
        starts: from which the sections where most is lost begin.
    """

    format: Literal[1] = 1
    raced: Raced
    car: int
    name: str
    lap: DrivenLap
    laps: tuple[DrivenLap, ...]
    other: str
    other_kind: Literal["champion", "driver", "recording"]
    other_lap_s: float
    limit_s: float | None
    lost_s: float
    sections: Annotated[tuple[CoachedSection, ...], Field(min_length=1)]
    consistency: Consistency | None
    craft: Craft
    advice: tuple[Advice, ...]
    alternatives: tuple[Advice, ...]
    attempts: tuple[CoachedAttempt, ...]
    together_s: float | None
    starts: tuple[StartState, ...]
    pace: CoachedPace | None = None
