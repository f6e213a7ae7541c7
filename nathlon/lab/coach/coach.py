"""The coach's work on one car of a recorded race: from its laps to facts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from nathlon.arena.race_log import RaceLog, start_number
from nathlon.lab.coach.craft import craft_of, serves, traffic
from nathlon.lab.coach.diagnosis import MIN_LOSS_S, ComparedParts, causes_of
from nathlon.lab.coach.driving import HANDS, DrivenTrial, Jolt, Rider, TrialPlan
from nathlon.lab.coach.edits import Edit, edits_of, full_throttle
from nathlon.lab.coach.lap import STEP_M, Lap, laps_of
from nathlon.lab.coach.parts import CoursePart, marks, parts_of
from nathlon.lab.coach.proof import (
    LEAST_GAIN_S,
    STARTS,
    TRUE_S,
    ProofTrial,
    ProofWindow,
    Proved,
    try_edits,
    window_of,
)
from nathlon.lab.coach.reference import Reference
from nathlon.reports.cars import labels
from nathlon.results.coach import (
    Advice,
    Cause,
    CoachedAttempt,
    CoachedPace,
    CoachedSection,
    CoachFacts,
    Consistency,
    DrivenLap,
    Raced,
    StartState,
)
from nathlon.sim.errors import InputError

SLOWER, EVERYWHERE = 0.98, 0.9
"""Whoever is slower than so much of the other's speed on so much of the lap is slower everywhere."""
BEFORE_M = 60.0
"""Before a section, where a start state is taken."""
MOST_STARTS = 8

OnDrives = Callable[[int, int], None]
"""Told how many drives with an edit have been made, and of how many."""


class _Ways(NamedTuple):
    """Other ways to drive a part.

    Attributes:
        window: that is driven.
        edits: to try.
        without: instead of a trial, where it would prove nothing.
    """

    window: ProofWindow
    edits: list[Edit]
    without: ProofTrial | None


@dataclass(frozen=True, eq=False)
class CoachedRace:
    """What the coach has found.

    Attributes:
        facts: all that is said.
        lap, other: the laps that were compared.
        drives: for each advice of the facts, the part driven again without the edit and with it.
    """

    facts: CoachFacts
    lap: Lap
    other: Lap
    drives: tuple[tuple[DrivenTrial, DrivenTrial], ...]


class Coach:
    """Looks at one car of a race.

    Args:
        log: the race.
        car: index of the car.
        reference: with what its best lap is compared.

    Attributes:
        pace: how much slower the car is everywhere; None where it is not.

    Raises:
        InputError: if the car has completed no lap.
    """

    def __init__(self, log: RaceLog, car: int, reference: Reference) -> None:
        self._log, self._car, self._reference = log, car, reference
        self._laps = laps_of(log, car)
        if not self._laps:
            raise InputError(f"car {start_number(car)} completes no lap of the race, expected one that does")
        self._lap = min(self._laps, key=lambda lap: lap.lap_s)
        self._length_m = (len(self._lap.time_s) - 1) * STEP_M
        self._parts = parts_of(log.sections, (self._lap, reference.lap))
        self.pace = self._pace()
        self._compared = [self._compare(part) for part in self._parts]

    def work(self, on_drives: OnDrives) -> CoachedRace:
        """Find out all there is, and prove the advice."""
        rider = Rider(self._log, self._lap)
        bends = {each.part.number: self._ways(each) for each in self._compared if each.improvable}
        drives = np.cumsum([0, *(len(STARTS) * len(ways.edits) for ways in bends.values())]).tolist()
        trials: dict[int, ProofTrial] = {}
        on_drives(0, drives[-1])
        for (number, ways), done in zip(bends.items(), drives[1:], strict=True):
            trials[number] = ways.without or try_edits(rider, self._lap, ways.window, ways.edits)
            on_drives(done, drives[-1])
        advice = [
            (self._advice(self._parts[number], trial, trial.best[0]), trial.best[0])
            for number, trial in trials.items()
            if trial.best
        ]
        advice.sort(key=lambda each: -each[0].gain_s)
        facts = CoachFacts(
            raced=Raced.model_validate(
                {name: getattr(self._log, name) for name in Raced.model_fields}, from_attributes=False
            ),
            car=self._car,
            name=self._log.names[self._car],
            lap=_driven_lap(self._lap),
            laps=tuple(_driven_lap(lap) for lap in self._laps),
            other=self._reference.name,
            other_kind=self._reference.kind,
            other_lap_s=round(self._reference.lap.lap_s, 3),
            limit_s=self._reference.limit_s,
            lost_s=round(self._lap.lap_s - self._reference.lap.lap_s, 3),
            sections=self.sections(),
            pace=self.pace,
            consistency=self._consistency(),
            craft=craft_of(self._log, self._car),
            advice=tuple(one for one, _ in advice),
            alternatives=tuple(
                self._advice(self._parts[number], trial, one)
                for number, trial in trials.items()
                for one in trial.best[1:]
            ),
            attempts=tuple(
                CoachedAttempt(
                    section=self._parts[number].name,
                    tried=trial.tried,
                    gained=len(trial.best),
                    unproved=trial.untrue,
                )
                for number, trial in trials.items()
            ),
            together_s=self._together(rider, [one for _, one in advice]),
            starts=tuple(self._starts()),
        )
        return CoachedRace(
            facts, self._lap, self._reference.lap, tuple((one.again, one.edited) for _, one in advice)
        )

    def _compare(self, part: CoursePart) -> ComparedParts:
        if not part.bend:
            return ComparedParts(self._lap, self._reference.lap, part, None)
        after = self._parts[part.number + 1].end_m if part.number + 1 < len(self._parts) else part.end_m
        does, shows = (marks(lap, part.start_m, part, after) for lap in (self._lap, self._reference.lap))
        return ComparedParts(self._lap, self._reference.lap, part, (does, shows), self.pace is not None)

    def _ways(self, compared: ComparedParts) -> _Ways:
        """What is to be tried in a part: nothing where another car is near, or the stewards slow it down."""
        part, lap = compared.part, self._lap
        window = window_of(self._parts, part, self._length_m)
        began, ended = (lap.start_s + lap.time_s[lap.at(at)] for at in (window.start_m, window.end_m))
        near = traffic(self._log, self._car, began, ended)
        why = f"{near[1]} is near" if near else ""
        if serves(self._log, self._car, began, ended):
            why = "a penalty is served there"
        if why:
            return _Ways(window, [], ProofTrial(window, 0, (), why))
        if compared.marks is None:
            return _Ways(window, list(full_throttle(part, lap)), None)
        return _Ways(window, list(edits_of(part, lap, compared.other, *compared.marks)), None)

    def sections(self) -> tuple[CoachedSection, ...]:
        """The parts of the lap, with what is lost in each and why."""
        return tuple(self._section(each) for each in self._compared)

    def _pace(self) -> CoachedPace | None:
        own, other = self._lap.speed, self._reference.lap.speed
        places = min(len(own), len(other))
        ratio = own[:places] / np.maximum(other[:places], 1.0)
        slower = float((ratio < SLOWER).mean())
        if self._lap.standing or slower < EVERYWHERE:
            return None
        return CoachedPace(speed_share=round(float(np.median(ratio)), 3), slower_share=round(slower, 3))

    def _section(self, compared: ComparedParts) -> CoachedSection:
        part, own, other = compared.part, compared.own, compared.other
        middle = compared.middle_m
        spans = [lap.between(part.start_m, part.end_m) for lap in self._flying]
        others = self._others(compared)
        # Who is slowed down by the stewards is not to be told to drive faster.
        own_doing = [] if any(one.kind == "penalty" for one in others) else causes_of(compared)
        return CoachedSection(
            name=part.name,
            kind=part.kind,
            start_m=part.start_m,
            end_m=part.end_m,
            time_s=round(own.between(part.start_m, part.end_m), 3),
            other_s=round(other.between(part.start_m, part.end_m), 3),
            lost_s=round(compared.lost_s, 3),
            entry_lost_s=None if middle is None else round(compared.lost(part.start_m, middle), 3),
            exit_lost_s=None if middle is None else round(compared.lost(middle, part.end_m), 3),
            spread_s=round(max(spans) - min(spans), 3) if len(spans) > 1 else None,
            causes=(*own_doing, *others),
        )

    def _others(self, compared: ComparedParts) -> list[Cause]:
        """What other cars and the stewards have to do with a part."""
        part, lap, names = compared.part, self._lap, labels(self._log)
        from_s, until_s = (lap.start_s + float(lap.time_s[lap.at(at)]) for at in (part.start_m, part.end_m))
        found = []
        near = traffic(self._log, self._car, from_s, until_s)
        if near is not None and compared.lost_s >= MIN_LOSS_S:
            cause = compared.cause("traffic", part.start_m, near[0], unit="m ahead")
            found.append(cause.model_copy(update={"car": near[1]}))
        for incident in self._log.incidents:
            touched = incident.kind == "contact" and self._car in incident.cars
            if not touched or not from_s <= incident.time_s < until_s:
                continue
            since_s = incident.time_s - lap.start_s
            at_m = float(np.interp(since_s, lap.time_s, np.arange(len(lap.time_s)))) * STEP_M
            others = [names[one] for one in incident.cars if one != self._car]
            cause = compared.cause("contact", at_m, 3.6 * incident.closing_m_s, unit="km/h")
            found.append(cause.model_copy(update={"car": others[0] if others else None}))
        if serves(self._log, self._car, from_s, until_s):
            found.append(compared.cause("penalty", part.start_m))
        return found

    @property
    def _flying(self) -> list[Lap]:
        return [lap for lap in self._laps if not lap.standing]

    def _consistency(self) -> Consistency | None:
        flying = self._flying
        if len(flying) < 2:
            return None
        times = np.array([lap.lap_s for lap in flying])
        spans = np.array([[lap.between(part.start_m, part.end_m) for part in self._parts] for lap in flying])
        spread = spans.max(axis=0) - spans.min(axis=0)
        worst = int(np.argmax(spread))
        return Consistency(
            laps=len(flying),
            best_s=round(float(times.min()), 3),
            mean_s=round(float(times.mean()), 3),
            deviation_s=round(float(times.std(ddof=1)), 3),
            sum_of_best_s=round(float(spans.min(axis=0).sum()), 3),
            least_steady=self._parts[worst].name,
            least_steady_s=round(float(spread[worst]), 3),
        )

    def _advice(self, part: CoursePart, trial: ProofTrial, proved: Proved) -> Advice:
        compared, lap, edit = self._compared[part.number], self._lap, proved.edit
        does = compared.marks[0] if compared.marks else None
        amount, unit, at_m = edit.amount, "m", (does and does.brake_m) or part.start_m
        side: Literal["left", "right"] | None = None
        if does is None:
            amount, unit = 100.0 * edit.amount, "%"
        elif edit.kind == "more_speed":
            (gained, at_m), unit = _faster(proved, part, does.apex_m), "km/h"
            amount = 3.6 * gained
        elif edit.kind == "throttle_earlier":
            at_m = does.full_m or does.apex_m
        elif edit.kind == "line":
            amount, at_m = _moved(proved, part)
            side = "left" if amount > 0.0 else "right"
        return Advice(
            section=part.name,
            number=part.number,
            kind=edit.kind,
            amount=round(abs(amount), 1),
            unit=unit,
            share=100.0 * edit.amount if edit.kind == "line" else None,
            side=side,
            at_m=round(at_m, 1),
            at_s=round(lap.start_s + float(lap.time_s[lap.at(at_m)]), 2),
            from_m=round(trial.window.start_m, 1),
            until_m=round(trial.window.end_m, 1),
            gain_s=round(proved.gain_s, 3),
            section_gain_s=round(proved.section_gain_s, 3),
            recorded_s=round(proved.recorded_s, 3),
            again_s=round(proved.again_s, 3),
            edited_s=round(proved.edited_s, 3),
            starts=proved.starts,
        )

    def _together(self, rider: Rider, proved: Sequence[Proved]) -> float | None:
        """What all advice gains at once over the lap, s; None where it does not, or cannot be driven."""
        if len(proved) < 2 or self._lap.standing:
            return None
        own, length = TrialPlan.of(self._lap), self._length_m
        plan = own.with_changes(tuple(one.edit.plan for one in proved))
        for hands in HANDS:
            again, edited = rider.drive([(own, Jolt()), (plan, Jolt())], 0.0, length, hands)
            before, after = again.until(length), edited.until(length)
            # What differs from part to part adds up as chance does.
            true = abs(before - self._lap.lap_s) < TRUE_S * len(self._parts) ** 0.5
            if again.clean and edited.clean and true:
                gain = min(before, self._lap.lap_s) - after
                return round(gain, 3) if gain >= LEAST_GAIN_S else None
        return None

    def _starts(self) -> list[StartState]:
        """Moments before the bends where most is lost, the greatest loss first."""
        lost = [each for each in self._compared if each.part.bend and each.lost_s >= MIN_LOSS_S]
        lost.sort(key=lambda each: -each.lost_s)
        found = []
        for each in lost[:MOST_STARTS]:
            lap, index = self._lap, self._lap.at(max(each.part.start_m - BEFORE_M, 0.0))
            found.append(
                StartState(
                    section=each.part.name,
                    lost_s=round(each.lost_s, 3),
                    progress_m=index * STEP_M,
                    lateral_m=round(float(lap.lateral[index]), 3),
                    heading_rad=round(float(lap.heading[index]), 4),
                    speed_m_s=round(float(lap.speed[index]), 3),
                    side_speed_m_s=round(float(lap.side_speed[index]), 3),
                    yaw_rate_rad_s=round(float(lap.yaw_rate[index]), 4),
                )
            )
        return found


def _driven_lap(lap: Lap) -> DrivenLap:
    return DrivenLap(
        number=lap.number,
        lap_s=round(lap.lap_s, 3),
        start_s=round(lap.start_s, 2),
        flying=not lap.standing,
        off_course=bool(lap.off_course.any()),
    )


def _faster(proved: Proved, part: CoursePart, apex_m: float) -> tuple[float, float]:
    """By how many m/s a part is driven faster at its slowest place, or else where it is most, and where."""
    at = np.array([apex_m, *np.arange(part.start_m, part.end_m, STEP_M)])
    before, after = (np.interp(at, drive.places, drive.speed) for drive in (proved.again, proved.edited))
    gained = after - before
    most = int(np.argmax(gained))
    if gained[0] >= 0.5 * gained[most]:
        most = 0
    return float(gained[most]), float(at[most])


def _moved(proved: Proved, part: CoursePart) -> tuple[float, float]:
    """By how many metres to the left a line is moved at most in a part, and where."""
    at = np.arange(part.start_m, part.end_m, STEP_M)
    before, after = (np.interp(at, drive.places, drive.lateral) for drive in (proved.again, proved.edited))
    most = int(np.argmax(np.abs(after - before)))
    return float(after[most] - before[most]), float(at[most])
