"""What a person chooses to drive, and the match that comes of it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, ConfigDict
from pydantic import Field as Bounds

from nathlon.arena.entrance import home
from nathlon.arena.entrant import CAR, CIRCUIT, Entrant, enter, only_once
from nathlon.arena.job import Opening
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.lab.drive.aids import Aids
from nathlon.lab.drive.difficulty import CHOSEN, Difficulty, HeatField, tempered
from nathlon.lab.drive.forecast import Setting
from nathlon.policies.apart import PolicyApart, is_guest
from nathlon.policies.load import load_policy
from nathlon.policies.patience import FIRST_ANSWER_S
from nathlon.policies.policy import Policy
from nathlon.policies.sources import COMPOSITE, DRIVER, HUMAN, OBJECT, PLUGIN
from nathlon.policies.temper import FAIR, TemperName
from nathlon.selection.bounds import LARGEST_SEED
from nathlon.sim.car import load_car
from nathlon.sim.data_file import DATA, Name
from nathlon.sim.errors import InputError
from nathlon.sim.names import proper_name
from nathlon.sim.scenario_start import MOST_CARS
from nathlon.sim.track import load_track
from nathlon.sim.validation import read_json

MOST_LAPS = 20
DRIVERS = tuple(f"{DRIVER}:pace={pace}" for pace in (1.0, 0.97, 0.94, 0.9, 0.85))
"""Who can race anywhere, in any car."""
ANSWER_S = 0.5
"""An opponent that has not answered for so long is out: the person waits for it."""
UNDER_WAY = "person under way"
"""Id of a person whose race has not ended, of which there are no inputs yet."""


class DriveOpponent(NamedTuple):
    """A policy that the person may race.

    Attributes:
        source: what it is called by.
        name: as the page shows it.
        circuit, car: that it was made for; None for any.
    """

    source: str
    name: str
    circuit: str | None
    car: str | None

    @classmethod
    def of(cls, source: str, name: str | None = None) -> DriveOpponent:
        """The opponent that a source gives.

        Raises:
            InputError: if its file cannot be read.
        """
        [opponent] = cls.all({source: name})
        return opponent

    @classmethod
    def all(cls, named: Mapping[str, str | None]) -> list[DriveOpponent]:
        """The opponents that some sources give, by the names that they shall have; None for their own.

        Raises:
            InputError: if a file cannot be read.
        """
        files = [
            source
            for source in named
            if source.partition(":")[0] not in (DRIVER, PLUGIN, OBJECT) and not source.endswith(COMPOSITE)
        ]
        homes = dict(zip(files, _opened([Opening(one, home, (Path(one),)) for one in files]), strict=True))
        return [
            cls(source, name or Path(source).stem, *homes[source])
            if source in homes
            else cls(source, name or source, None, None)
            for source, name in named.items()
        ]

    def drives(self, circuit: str, car: str) -> bool:
        """Whether it was made for this."""
        return self.circuit in (None, circuit) and self.car in (None, car)


class Choice(BaseModel):
    """What a person wants to drive.

    Attributes:
        name: of the person.
        circuit, car: shipped names.
        cars: on the grid, with the person's.
        seat: the person's place on it, from pole.
        laps: of the race.
        opponents: indices of those offered, who fill the other places in turn, if they are chosen.
        difficulty: how good the opponents are otherwise.
        temper: of those that are built-in drivers.
        aids: which driving aids are on.
        seed: of the start.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    name: Annotated[Name, Bounds(max_length=40)]
    circuit: str
    car: str
    cars: Annotated[int, Bounds(ge=1, le=MOST_CARS)]
    seat: Annotated[int, Bounds(ge=1, le=MOST_CARS)]
    laps: Annotated[int, Bounds(ge=1, le=MOST_LAPS)]
    opponents: Annotated[tuple[int, ...], Bounds(max_length=MOST_CARS - 1)]
    difficulty: Difficulty = CHOSEN
    temper: TemperName = FAIR
    aids: Aids = Aids()
    seed: Annotated[int, Bounds(ge=0, le=LARGEST_SEED)] = 1

    @classmethod
    def read(cls, value: object) -> Choice:
        """A choice that the page has sent.

        Raises:
            InputError: if it is none.
        """
        # As JSON: strict models take no lists for tuples otherwise.
        choice = read_json(json.dumps(value), cls, "the choice")
        if choice.seat > choice.cars:
            raise InputError(f"the choice: seat is {choice.seat}, expected a place from 1 to {choice.cars}")
        if choice.cars > 1 and not choice.opponents and choice.difficulty == CHOSEN:
            raise InputError(f"the choice: {choice.cars} cars and no opponent, expected at least one")
        return choice

    @property
    def scenario(self) -> str:
        """The scenario of the race."""
        return f"drive:laps={self.laps},cars={self.cars},person={self.seat}"

    @property
    def setting(self) -> Setting:
        """Where the race is and who starts from which place."""
        return Setting(self.circuit, self.car, self.cars, self.seat, self.laps)


class Offer(NamedTuple):
    """What there is to choose from.

    Attributes:
        opponents: those named first.
        circuits, cars: shipped names, and paths that were named on the command line; those first.
        difficulty, temper: that are set at first; None for what the person has chosen last.
        unchosen: the difficulty for a person who has chosen none yet.
    """

    opponents: tuple[DriveOpponent, ...]
    circuits: tuple[str, ...]
    cars: tuple[str, ...]
    difficulty: Difficulty | None = None
    temper: TemperName | None = None
    unchosen: Difficulty = CHOSEN

    @classmethod
    def of(
        cls, opponents: Sequence[DriveOpponent], circuit: str | None = None, car: str | None = None
    ) -> Offer:
        """Opponents and the built-in driver at several paces, shipped circuits and cars.

        Args:
            opponents: who there is to race.
            circuit, car: to be offered first, shipped names or paths; by default those of an opponent.

        Raises:
            InputError: if there is no such circuit or car.
        """
        homes = [(one.circuit, one.car) for one in opponents if one.circuit and one.car]
        there = homes[0] if homes and (CIRCUIT, CAR) not in homes else (CIRCUIT, CAR)
        circuit, car = circuit or there[0], car or there[1]
        load_track(circuit)
        load_car(car)
        drivers = (DriveOpponent.of(source) for source in DRIVERS)
        return cls(
            tuple({one.source: one for one in (*opponents, *drivers)}.values()),
            tuple(dict.fromkeys((circuit, *shipped("circuit")))),
            tuple(dict.fromkeys((car, *shipped("car")))),
        )


def shipped(kind: str) -> list[str]:
    """Names of the circuits or cars that come with nathlon."""
    return sorted(path.stem for path in (DATA / f"{kind}s").iterdir())


class DrivePlan(NamedTuple):
    """A race to be driven.

    Attributes:
        choice: what the person wanted.
        match: of one race; the person is its last entrant, `UNDER_WAY`.
        entrants: those of the match.
        policies: of its entrants but the person.
        field: the opponents of a difficulty; None where they were chosen.
    """

    choice: Choice
    match: Match
    entrants: tuple[Entrant, ...]
    policies: tuple[Policy, ...]
    field: HeatField | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Of the entrants."""
        return tuple(entrant.name for entrant in self.entrants)

    @property
    def grid(self) -> tuple[str, ...]:
        """Names of those who start, from pole."""
        return tuple(self.names[seat.entrant] for seat in self.match.races[0].seats)


def check_place(choice: Choice, offer: Offer) -> None:
    """Raise an InputError if circuit or car are not offered."""
    for field, name, known in (("circuit", choice.circuit, offer.circuits), ("car", choice.car, offer.cars)):
        if name not in known:
            raise InputError(f"the choice: {field} {name!r} is unknown, expected one of {', '.join(known)}")


def plan(choice: Choice, offer: Offer, field: HeatField | None = None) -> DrivePlan:
    """The race of a choice.

    Args:
        choice: what the person wants.
        offer: what there is.
        field: the opponents, instead of those chosen.

    Raises:
        InputError: if something is not offered, or an opponent cannot drive there.
    """
    check_place(choice, offer)
    circuit, car = choice.circuit, choice.car
    sources = field.sources if field else _chosen(choice, offer)
    others = entered(sources, circuit, car)
    person = Entrant(UNDER_WAY, f"{HUMAN}:{proper_name(choice.name)}", "", "person", circuit, car, None, None)
    entrants = tuple(only_once([*others, person]))
    human = len(entrants) - 1
    places = iter(range(choice.cars))
    seats = tuple(
        Seat(human if place == choice.seat - 1 else next(places) % human) for place in range(choice.cars)
    )
    match = Match(
        "race",
        "drive",
        choice.scenario,
        circuit,
        car,
        tuple(entrant.id for entrant in entrants),
        tuple(entrant.source for entrant in entrants),
        (Race(choice.seed, seats),),
    )
    policies = tuple(
        _ready(entrant.source, circuit, car, choice.seed + index)
        for index, entrant in enumerate(entrants[:human])
    )
    return DrivePlan(choice, match, entrants, policies, field)


def entered(sources: Sequence[str], circuit: str, car: str) -> list[Entrant]:
    """The entrants that sources give.

    Raises:
        InputError: if one cannot drive there.
    """
    return _opened([Opening(source, enter, (source, circuit, car)) for source in sources])


def _opened(openings: Sequence[Opening]) -> list[Any]:
    """What opening policies gives: guests in a process that may hang or end, all others here."""
    guests = [opening for opening in openings if is_guest(opening.source)]
    answers: dict[Opening, Any] = {}
    if guests:
        with Pool(1, first_answer_s=FIRST_ANSWER_S) as pool:
            answers = dict(zip(guests, pool.open(guests), strict=True))
    opened = []
    for opening in openings:
        answer = answers[opening] if opening in answers else opening.function(*opening.arguments)
        if isinstance(answer, InputError):
            raise answer
        opened.append(answer)
    return opened


def _ready(source: str, circuit: str, car: str, seed: int) -> Policy:
    """A policy that the race need not wait for: a guest has begun, and is out when it takes too long."""
    if not is_guest(source):
        return load_policy(source, circuit, car)
    guest = PolicyApart(source, circuit, car, ANSWER_S, FIRST_ANSWER_S)
    guest.warm_up(seed)
    return guest


def _chosen(choice: Choice, offer: Offer) -> list[str]:
    """Sources of the chosen opponents."""
    wanted, offered = list(dict.fromkeys(choice.opponents))[: choice.cars - 1], offer.opponents
    if any(not 0 <= index < len(offered) for index in wanted):
        raise InputError(f"the choice: opponents are {wanted}, expected numbers from 0 to {len(offered) - 1}")
    return [tempered(offered[index].source, choice.temper) for index in wanted]
