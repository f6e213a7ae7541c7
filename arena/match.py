"""The unit of work: some races of the same policies, run as one batch of fixed shape.

A match's key is a hash of everything that decides its outcome, so that a finished match need never
run again. The batch is part of the match: matrix products round differently with the number of
rows, so races are never regrouped.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from typing import Any

from nathlon.arena.world_finding import RACING, find_world
from nathlon.sim.errors import InputError

NO_TEAM, TESTED, BACKGROUND = -1, 0, -2

UNDECIDING = ("sources", "races", "swap", "classes")
"""Fields of a match that its spec does not take as they are."""


@dataclass(frozen=True)
class Seat:
    """A starting place taken: by which of the match's entrants, for which team.

    The team is -1 where there are none, `TESTED` where the match is a test of whoever sits there, and
    `BACKGROUND` where that entrant only makes up the numbers.
    """

    entrant: int
    team: int = -1


@dataclass(frozen=True)
class Race:
    """One race: the seed of its start, and who starts where, from pole to last."""

    seed: int
    seats: tuple[Seat, ...]
    mirrored: bool = False


@dataclass(frozen=True)
class Swap:
    """Another entrant at the wheel of a car from a moment on, without memory of what was before.

    Attributes:
        race, car: which car, as indices.
        entrant: who drives it then; it needs no seat.
        from_s: when, s since the start.
    """

    race: int
    car: int
    entrant: int
    from_s: float


@dataclass(frozen=True)
class Match:
    """Races of one scenario between some entrants.

    Attributes:
        stage: what it is for: pareto, battery, tournament, race.
        test: name by which the stage knows it.
        circuit, car: where the world has several; empty where it has none.
        entrants: ids of the policies.
        sources: where to load them from; does not decide the outcome.
        world: name of the simulator, see `nathlon.arena.world_finding`.
        swap: of a car's driver; None in all matches that decide something.
        classes: the car of each entrant, where they are not all the same; `car` is the first of them.
    """

    stage: str
    test: str
    scenario: str
    circuit: str
    car: str
    entrants: tuple[str, ...]
    sources: tuple[str, ...]
    races: tuple[Race, ...]
    world: str = RACING
    swap: Swap | None = None
    classes: tuple[str, ...] = ()

    @classmethod
    def from_spec(cls, spec: Mapping[str, Any], sources: Mapping[str, str]) -> Match:
        """The match that a stored spec describes.

        Args:
            spec: as `Match.spec` made it.
            sources: where to load its entrants from, by their ids; a built-in driver is its own source.

        Raises:
            InputError: if the program or its data have changed since, so that the match would end otherwise.
        """
        races = [
            Race(race["seed"], tuple(Seat(**seat) for seat in race["seats"]), race["mirrored"])
            for race in spec["races"]
        ]
        entrants = tuple(spec["entrants"])
        match = cls(
            spec["stage"],
            spec["test"],
            spec["scenario"],
            spec["circuit"],
            spec["car"],
            entrants,
            tuple(sources.get(entrant, entrant) for entrant in entrants),
            tuple(races),
            spec["world"],
            classes=tuple(spec.get("classes", ())),
        )
        if json.dumps(match.spec(), sort_keys=True) != json.dumps(spec, sort_keys=True):
            raise InputError(
                f"match {spec['test']} of {len(races)} races: the simulator or its data have changed "
                "since it was run, expected those that it was run with"
            )
        return match

    @cached_property
    def key(self) -> str:
        """SHA-256 in hexadecimal of all that decides the outcome."""
        return hashlib.sha256(json.dumps(self.spec(), sort_keys=True).encode()).hexdigest()

    def check_here(self) -> None:
        """Raise InputError if what decides the outcome is not what it was when the match got its key.

        The key may be of another process, which loaded a world or a loader before its file was changed.
        """
        if "key" in self.__dict__ and replace(self).key != self.key:
            raise InputError(
                f"world {self.world!r}: its code or its data have changed since the run began, "
                "expected the same to its end"
            )

    @property
    def cars(self) -> tuple[str, ...]:
        """All that are driven, each once."""
        return tuple(dict.fromkeys(self.classes or (self.car,)))

    def car_of(self, entrant: int) -> str:
        """What one of the entrants drives."""
        return self.classes[entrant] if self.classes else self.car

    def seat_facts(self, race: int, car: int) -> dict[str, Any]:
        """What a row of RESULTS says of a seat before anything is driven."""
        run = self.races[race]
        seat = run.seats[car]
        return {
            "match": self.key,
            "stage": self.stage,
            "test": self.test,
            "race": race,
            "seed": run.seed,
            "mirrored": run.mirrored,
            "car": car,
            "slot": car + 1,
            "entrant": self.entrants[seat.entrant],
            "team": seat.team,
        }

    def spec(self) -> dict[str, Any]:
        """All that decides the outcome, as plain JSON values."""
        facts = {one.name: getattr(self, one.name) for one in fields(self) if one.name not in UNDECIDING}
        # `asdict` copies value by value, which takes longer than racing where matches have many seats.
        facts["races"] = [vars(race) | {"seats": [vars(seat) for seat in race.seats]} for race in self.races]
        if self.swap is not None:
            facts["swap"] = asdict(self.swap)
        if self.classes:
            facts["classes"] = list(self.classes)
            facts["class_facts"] = {car: self._surroundings(car) for car in self.cars}
        return facts | self._surroundings(self.car)

    def _surroundings(self, car: str) -> dict[str, Any]:
        return find_world(self.world, self.circuit, car).facts(self.scenario)
