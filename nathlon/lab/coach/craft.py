"""The coached car among others: passes, defences, contacts, and where traffic costs time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.passes import passes
from nathlon.arena.race_log import Incident, RaceLog, lap_length, origin, progress
from nathlon.reports.cars import labels
from nathlon.results.coach import CoachedContact, Craft, Defence, Fault, Mishap, Passing

NEAR_M = 30.0
"""A car within so much along the road, ahead or beside, is traffic."""
PRESSED_M = 15.0
"""A car so close behind presses,"""
PRESSED_S = 3.0
"""if it does for so long."""
MISHAPS = ("wall", "off_course", "penalty", "served")


def craft_of(log: RaceLog, car: int) -> Craft:
    """What the car did among others, and what the stewards noted of it."""
    names = labels(log)
    made = [one for one in passes(log) if car in (one.car, one.passed)]
    return Craft(
        passes=tuple(
            Passing(
                at_s=round(one.time_s, 1),
                by_car=one.car == car,
                car=names[one.passed if one.car == car else one.car],
                place=one.place,
                section="" if one.section < 0 else log.sections[one.section].name,
                stands=one.stands,
            )
            for one in made
        ),
        defences=tuple(_defences(log, car)),
        contacts=tuple(_contact(log, car, i) for i in log.incidents if i.kind == "contact" and car in i.cars),
        mishaps=tuple(
            Mishap(at_s=round(i.time_s, 1), kind=i.kind, penalty_s=round(i.penalty_s, 1), text=i.text)
            for i in log.incidents
            if i.kind in MISHAPS and car in i.cars
        ),
    )


def _contact(log: RaceLog, car: int, incident: Incident) -> CoachedContact:
    others = [one for one in incident.cars if one != car] or [car]
    fault: Fault = "nobody" if incident.fault < 0 else "own" if incident.fault == car else "other"
    row = int(np.clip(np.searchsorted(log.time_s, incident.time_s), 0, len(log.time_s) - 1))
    return CoachedContact(
        at_s=round(incident.time_s, 1),
        car=labels(log)[others[0]],
        closing_m_s=round(incident.closing_m_s, 1),
        fault=fault,
        section=_section_of(log, row, car),
        text=incident.text,
    )


def _section_of(log: RaceLog, row: int, car: int) -> str:
    place = (progress(log)[row, car] + origin(log)) % lap_length(log.outline)
    held = [section.name for section in log.sections if section.start_m <= place < section.end_m]
    return held[0] if held else ""


def _defences(log: RaceLog, car: int) -> Iterator[Defence]:
    along, driving = progress(log), log.samples["driving"]
    for other, name in enumerate(labels(log)):
        if other == car:
            continue
        behind = along[:, car] - along[:, other]
        close = (behind > 0.0) & (behind < PRESSED_M) & driving[:, car] & driving[:, other]
        for first, last in _runs(close):
            if log.time_s[last] - log.time_s[first] >= PRESSED_S:
                after = along[min(last + 1, len(along) - 1)]
                yield Defence(
                    from_s=round(float(log.time_s[first]), 1),
                    until_s=round(float(log.time_s[last]), 1),
                    car=name,
                    closest_m=round(float(behind[first : last + 1].min()), 1),
                    held=bool(after[car] >= after[other]),
                )


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of each run of true ones."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(first), int(last) - 1) for first, last in edges.reshape(-1, 2)]


def serves(log: RaceLog, car: int, from_s: float, until_s: float) -> bool:
    """Whether a car serves some of a penalty in a time: then the stewards slow it down."""
    rows = slice(*np.searchsorted(log.time_s, [from_s, until_s]).tolist())
    return bool((np.diff(log.samples["penalty_s"][rows, car]) < 0.0).any())


def traffic(log: RaceLog, car: int, from_s: float, until_s: float) -> tuple[float, str] | None:
    """The nearest car ahead of or beside a car in a time: metres ahead, and its name; None without any."""
    rows = slice(*np.searchsorted(log.time_s, [from_s, until_s]).tolist())
    along, driving = progress(log)[rows], log.samples["driving"][rows]
    ahead = along - along[:, [car]]
    near = driving & (ahead > -log.car_length_m) & (ahead < NEAR_M)
    near[:, car] = False
    if not near.any():
        return None
    nearest = np.where(near, np.abs(ahead), np.inf)
    row, other = np.unravel_index(int(np.argmin(nearest)), nearest.shape)
    return float(ahead[row, other]), labels(log)[int(other)]
