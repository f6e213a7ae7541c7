"""Notes down what a steward would look at while a race is run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.race_log import Incident, numbered
from nathlon.sim.rules import Rules
from nathlon.sim.state import REAR_END, SIDE_SWIPE
from nathlon.sim.track import Track
from nathlon.sim.world import World

APART_S = 1.0
"""Wall contacts or excursions of a car closer together than this are one."""
FLAGS = {"wall_contact": ("wall", "hits the wall"), "off_course": ("off_course", "leaves the course")}
"""Flags of CAR_STATE: the kind of incident when one is raised, and what the car does."""
TALLIES = ("warnings", "penalties", "penalty_s")
"""Fields of CAR_STATE whose change is the stewards' doing."""


class Alarm:
    """Tells after each step of a world in which of some races there may be something to note."""

    def __init__(self, races: Sequence[int]) -> None:
        """Of the races with these indices; nothing has been seen yet."""
        self._races = list(races)
        self._before: dict[str, NDArray[np.generic]] = {}

    def __call__(self, world: World) -> NDArray[np.bool_]:
        """(races,) bool, after the world's last step; to be called after every one."""
        raised = (world.contact_count[self._races] > 0)[:, None]
        for flag in FLAGS:
            raised = raised | world.state[flag][self._races]
        tallies = {name: world.state[name][self._races] for name in TALLIES}
        for name, tally in tallies.items():
            raised = raised | (tally != self._before.get(name, 0))
        self._before = tallies
        return np.asarray(raised.any(axis=1))


class IncidentWatch:
    """Follows one race of a world from its start.

    Attributes:
        incidents: noted so far.
    """

    def __init__(self, race: int, names: Sequence[str], rules: Rules, track: Track) -> None:
        """Nothing has been seen yet.

        Args:
            race: its index in the world.
            names: of its cars.
            rules: that its stewards go by.
            track: on which it is run.
        """
        self._race, self._rules, self._track = race, rules, track
        self._names = numbered(names)
        self._before = {name: np.zeros(len(names)) for name in TALLIES}
        self._raised_s = {flag: np.full(len(names), -np.inf) for flag in FLAGS}
        self.incidents: list[Incident] = []

    def see(self, world: World) -> None:
        """Note what happened in the world's last step; to be called after every one that raises an Alarm."""
        cars, now = world.state[self._race], float(world.time[self._race])
        contacts = world.new_contacts(self._race)
        self.incidents += [self._contact(contact, cars) for contact in contacts]
        self.incidents += self._mishaps(cars, now)
        if any((cars[name] != self._before[name]).any() for name in TALLIES):
            penalised = np.bincount(contacts["fault"][contacts["penalty_s"] > 0.0], minlength=len(cars))
            self.incidents += self._penalties(cars, penalised, now)
            self._before = {name: cars[name].copy() for name in TALLIES}

    def _contact(self, contact: np.void, cars: NDArray[np.void]) -> Incident:
        first, second = int(contact["behind"]), int(contact["ahead"])
        blamed = contact["fault"] >= 0
        if contact["fault"] == second:
            first, second = second, first
        a, b = self._names[first], self._names[second]
        match int(contact["geometry"]):
            case geometry if geometry == REAR_END:
                what = f"{a} {'runs into' if blamed else 'touches'} the rear of {b}"
            case geometry if geometry == SIDE_SWIPE and blamed:
                what = f"{a} moves across into {b}"
            case geometry if geometry == SIDE_SWIPE:
                what = f"{a} and {b} touch side by side"
            case _:
                what = f"{a} and {b} collide"
        sections = (int(contact["section_behind"]), int(contact["section_ahead"]))
        where = list(dict.fromkeys(self._track.sections[index].name for index in sections if index >= 0))
        if len(where) == 2:
            place = f"between {where[0]} and {where[1]}"
        else:
            place = f"in {where[0]}" if where else self._metres(cars[first])
        text = f"{what} at {contact['closing']:.1f} m/s {place}{_sentence(contact['penalty_s'])}"
        return Incident(
            float(contact["time"]),
            "contact",
            (first, second),
            text,
            int(contact["fault"]),
            float(contact["closing"]),
            float(contact["penalty_s"]),
        )

    def _mishaps(self, cars: NDArray[np.void], now: float) -> Iterator[Incident]:
        for flag, (kind, verb) in FLAGS.items():
            if not cars[flag].any():
                continue
            for car in np.flatnonzero(cars[flag] & (now - self._raised_s[flag] > APART_S)).tolist():
                yield Incident(now, kind, (car,), f"{self._names[car]} {verb} {self._where(cars[car])}")
            self._raised_s[flag][cars[flag]] = now

    def _penalties(
        self, cars: NDArray[np.void], penalised: NDArray[np.int64], now: float
    ) -> Iterator[Incident]:
        """Penalties beyond those for contacts, of which `penalised` is the number by car; those served."""
        limits, cutting = self._rules.limits, self._rules.cutting
        warned = np.maximum(self._before["warnings"], limits.warnings)
        strayed = np.maximum(cars["warnings"] - warned, 0) * (limits.penalty_s > 0.0)
        cut = cars["penalties"] - self._before["penalties"] - penalised - strayed
        for car in np.flatnonzero(cut > 0).tolist():
            text = (
                f"{self._names[car]} cuts the course {self._where(cars[car])}{_sentence(cutting.penalty_s)}"
            )
            yield Incident(now, "penalty", (car,), text, penalty_s=cutting.penalty_s)
        for car in np.flatnonzero(strayed > 0).tolist():
            what = f"has left the course {cars['warnings'][car]} times, now {self._where(cars[car])}"
            text = f"{self._names[car]} {what}{_sentence(limits.penalty_s)}"
            yield Incident(now, "penalty", (car,), text, penalty_s=limits.penalty_s)
        for car in np.flatnonzero((self._before["penalty_s"] > 0.0) & (cars["penalty_s"] == 0.0)).tolist():
            yield Incident(now, "served", (car,), f"{self._names[car]} has served its penalties")

    def _where(self, car: np.void) -> str:
        section = self._track.section_at(float(car["progress"]))
        return f"in {section}" if section else self._metres(car)

    def _metres(self, car: np.void) -> str:
        return f"at {car['progress'] % self._track.length:.0f} m"


def _sentence(penalty_s: float) -> str:
    return f": {penalty_s:g} s penalty" if penalty_s > 0.0 else ""
