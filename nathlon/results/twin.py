"""Two races from one start, as pages and replays show them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from nathlon.arena.race_log import RaceLog
from nathlon.arena.sight import Seen


class Side(NamedTuple):
    """One of the two races.

    Attributes:
        log: the race.
        seen: by the drivers of the car that is looked at, in turn; empty where it is not known.
    """

    log: RaceLog
    seen: tuple[Seen, ...] = ()


@dataclass(frozen=True)
class Twins:
    """A race and its twin.

    Attributes:
        original, twin: the two.
        car: index of the car that is looked at.
        at_s: from when another policy drives it, s; None where these are two races of their own.
        missing: why it is not known what was seen; empty where it is.
    """

    original: Side
    twin: Side
    car: int
    at_s: float | None = None
    missing: str = ""

    @property
    def parted_s(self) -> float | None:
        """When the races first differ, s: the last sample before which all cars are alike; None if never."""
        one, other = self.original.log, self.twin.log
        both = min(len(one.time_s), len(other.time_s))
        unlike = one.time_s[:both] != other.time_s[:both]
        for name in one.samples.dtype.names or ():
            unlike = unlike | (one.samples[name][:both] != other.samples[name][:both]).any(axis=1)
        if not unlike.any():
            return None if len(one.time_s) == len(other.time_s) else float(one.time_s[both - 1])
        return float(one.time_s[max(int(np.argmax(unlike)) - 1, 0)])


class TwinOutcome(NamedTuple):
    """How a race ended for a car.

    Attributes:
        place: at the end.
        ending: in words, with the time.
        contacts, blamed: contacts it was in, and those laid to it.
        off_course: how often it left the course.
        penalties: how many it was given.
    """

    place: int
    ending: str
    contacts: int
    blamed: int
    off_course: int
    penalties: int


def outcome(log: RaceLog, car: int) -> TwinOutcome:
    """How a race ended for a car."""
    own = [one for one in log.incidents if car in one.cars]
    endings = [one.text.rpartition(": ")[2] for one in own if one.kind == "ending"]
    contacts = [one for one in own if one.kind == "contact"]
    return TwinOutcome(
        place=int(log.samples["place"][-1, car]),
        ending=endings[-1] if endings else "under way",
        contacts=len(contacts),
        blamed=sum(one.fault == car for one in contacts),
        off_course=sum(one.kind == "off_course" for one in own),
        penalties=sum(one.penalty_s > 0.0 and one.fault in (car, -1) for one in own),
    )
