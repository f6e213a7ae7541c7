"""The moments of a race that one should look at."""

from __future__ import annotations

from nathlon.arena.passes import Pass, passes
from nathlon.arena.race_log import Incident, RaceLog, numbered
from nathlon.results.summary import Clip

BEFORE_S, AFTER_S = 6.0, 4.0
"""A clip begins so long before its moment and ends so long after it."""
LIGHT_M_S = 1.0
"""Closing speed up to which nobody asks who was to blame for a touch."""


def clips(log: RaceLog) -> list[Clip]:
    """The decisive pass of a race and its questionable contacts, in the order of time.

    Decisive is the last pass for the best place at which two cars of different sides changed places for good.
    Questionable are the hardest contact that the stewards laid to nobody, and the hardest that they laid to
    somebody: a verdict on either weighs most.
    """
    found = [*_decisive(log), *_questionable(log)]
    return sorted(found, key=lambda clip: clip.start_s)


def _decisive(log: RaceLog) -> list[Clip]:
    lasting = [one for one in passes(log) if one.stands and _opposed(log, one)]
    if not lasting:
        return []
    last = min(lasting, key=lambda one: (one.place, -one.time_s))
    where = f" in {log.sections[last.section].name}" if last.section >= 0 else ""
    names = numbered(log.names)
    what = f"the pass for place {last.place}: {names[last.car]} goes by {names[last.passed]}{where}"
    return [_clip(log, last.time_s, last.car, what)]


def _opposed(log: RaceLog, one: Pass) -> bool:
    mine, theirs = log.teams[one.car], log.teams[one.passed]
    return mine != theirs or mine < 0


def _questionable(log: RaceLog) -> list[Clip]:
    contacts = [one for one in log.incidents if one.kind == "contact" and one.closing_m_s > LIGHT_M_S]
    free = [one for one in contacts if one.fault < 0]
    blamed = [one for one in contacts if one.fault >= 0]
    return [
        _clip(log, hardest.time_s, hardest.cars[0], f"{verdict}: {hardest.text}")
        for verdict, those in (
            ("the hardest contact that nobody is blamed for", free),
            ("the hardest contact that a driver is blamed for", blamed),
        )
        for hardest in [max(those, key=_closing, default=None)]
        if hardest is not None
    ]


def _closing(incident: Incident) -> float:
    return incident.closing_m_s


def _clip(log: RaceLog, moment_s: float, car: int, why: str) -> Clip:
    start_s, end_s = max(moment_s - BEFORE_S, 0.0), min(moment_s + AFTER_S, float(log.time_s[-1]))
    return Clip(round(start_s, 1), round(end_s, 1), car, why)
