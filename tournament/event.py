"""Events: races on several circuits whose points are added up."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from nathlon.sim.car import load_car
from nathlon.sim.data_file import Name, Section, read_toml
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from nathlon.tournament.formats import FORMATS, Format, FormatName
from nathlon.tournament.sides import Sides


class EventRace(Section):
    """A race of an event.

    Attributes:
        name: of the race, unlike those of the others; its results are known by it.
        circuit, car: names of shipped ones, or paths of `.toml` files.
        format: of its matches.
        scenario: what is raced, the format's own if none is named; a shipped name or a path.
        weight: how often its points count.
        pairs: units of evidence of every matchup, at most; the tournament's if none are given.
    """

    name: Name
    circuit: str
    car: str
    format: FormatName = "4v4"
    scenario: str | None = None
    weight: Annotated[float, Field(ge=1e-6, le=1e6)] = 1.0
    pairs: Annotated[int, Field(ge=2, le=10_000)] | None = None

    @property
    def made(self) -> Format | Sides:
        """Its format."""
        return FORMATS[self.format]

    @property
    def raced(self) -> str:
        """Its scenario."""
        return self.scenario or FORMATS[self.format].scenario


class ScenarioRace(EventRace):
    """A scenario of another world, played by its sides.

    Attributes:
        sides: how many it has.
    """

    sides: int

    @property
    def made(self) -> Sides:
        """Its format."""
        return Sides(self.sides, FORMATS[self.format].gauntlet and self.sides == 2)

    @property
    def raced(self) -> str:
        """Its scenario, by whose name its results are known."""
        return self.name


class Event(Section):
    """An event as its file describes it: the tables `[[race]]`."""

    race: Annotated[tuple[EventRace, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _distinct(self) -> Event:
        names = [race.name for race in self.race]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two races are called {name!r}, expected a name of its own for each")
        return self

    @property
    def weights(self) -> dict[str, float]:
        """How often the points of each race count, by its name."""
        return {race.name: race.weight for race in self.race}


def load_event(path: Path) -> Event:
    """An event from its file.

    Raises:
        InputError: if the file is wrong, or names a circuit, car or scenario that is, or a scenario with
            another number of cars than the format.
    """
    event = read_toml(path, Event, "event")
    for race in event.race:
        load_track(race.circuit)
        load_car(race.car)
        cars = load_scenario(race.raced).cars
        if cars != FORMATS[race.format].cars:
            raise InputError(
                f"{path}: race {race.name!r}: scenario {race.raced!r} has {cars} cars, "
                f"expected {FORMATS[race.format].cars} for format {race.format}"
            )
    return event
