"""Scenarios: who starts where, and when a run ends. Training and evaluation use the same ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, TypeAdapter, ValidationError, model_validator

from nathlon.sim.camera_spec import MOST_BLUR, MOST_NOISE
from nathlon.sim.car import Car, load_compounds
from nathlon.sim.clock import AGENT_HZ, DYNAMICS_HZ
from nathlon.sim.conditions import Conditions, Start
from nathlon.sim.data_file import DATA, Name, Section, find_data, read_toml
from nathlon.sim.errors import InputError
from nathlon.sim.names import settings_of
from nathlon.sim.physics.course import DRY, GRIP, Multiple, SurfaceGrip
from nathlon.sim.reaction import Haze, Reaction
from nathlon.sim.rules import load_rules
from nathlon.sim.scenario_start import (
    MOST_CARS,
    AbreastStart,
    AnywhereStart,
    FormationStart,
    FrozenStart,
    GridStart,
    RollingStart,
)
from nathlon.sim.track import CURVATURE, LEFT, RIGHT, WALL_LEFT, WALL_RIGHT, Track
from nathlon.sim.weather import Film, Weather, draw
from nathlon.sim.world import World

SAFE_LATERAL = 8.0
"""m/s^2 of cornering that every car can hold: random starts are no faster than it allows."""
LOOK_AHEAD_M = 120.0
LENGTH_M, WIDTH_M = 5.2, 2.2
"""Room that a car takes when it is put beside the road."""
MOST_LAPS = 1000
LONGEST_S = 86_400.0
"""A day."""
Rate = Annotated[float, Field(ge=0, le=1e4)]


def _whole_period(hertz: float) -> float:
    if not 5.0 <= hertz <= DYNAMICS_HZ or DYNAMICS_HZ % hertz:
        raise ValueError("expected 5, 6, 10, 12, 15, 20, 30 or 60")
    return hertz


Hertz = Annotated[float, AfterValidator(_whole_period)]
LONGEST_DELAY_S = 0.3
Blur = Annotated[int, Field(ge=0, le=MOST_BLUR)]
Noise = Annotated[float, Field(ge=0.0, le=MOST_NOISE)]
Delay = Annotated[float, Field(ge=0.0, le=LONGEST_DELAY_S)]


class Scenario(Section):
    """A scenario as its file describes it.

    Attributes:
        cars: cars in a race.
        start: how they are placed.
        origin: name of the section at whose beginning rolling starts are placed, and before whose end
            those abreast, or `longest straight`, `last chicane`; without it they are placed from the line.
        laps: laps to drive; counted from the line.
        finish_m: m to drive from the line, or past the end of the origin, instead of laps.
        time_s: time at which the run ends for all.
        rules: what the stewards go by; a shipped name or the path of a `.toml` file.
        compound: of the tyres; the car's own if none is named.
        wear_rate, fuel_rate: multiples of the car's wear of tyres and use of fuel.
        grip: of the surfaces; dry if nothing is said.
        weather: what may come, one of which does; without any the road stays as it is.
        film_mm: water on the road at the start; needs weather.
        stops_when_needed: whether cars that have no plan stop for tyres and fuel when they need some.
        stop_after: laps after which they stop instead, once, for new tyres.
        action_hz: actions a second, one number or one for each starting place.
        perception_delay_s: from what happens to when it is seen, to the nearest 1/60 s; likewise.
        blur, noise: of all cameras, besides their own, see `nathlon.sim.camera_spec`.
    """

    name: Name
    description: str
    cars: Annotated[int, Field(ge=1, le=MOST_CARS)]
    start: Annotated[
        GridStart | RollingStart | FormationStart | AbreastStart | AnywhereStart | FrozenStart,
        Field(discriminator="kind"),
    ]
    origin: str | None = None
    laps: Annotated[int, Field(ge=1, le=MOST_LAPS)] | None = None
    finish_m: Annotated[float, Field(ge=-1e7, le=1e7)] | None = None
    time_s: Annotated[float, Field(gt=0, le=LONGEST_S)]
    rules: str = "free"
    compound: str | None = None
    wear_rate: Rate = 0.0
    fuel_rate: Rate = 0.0
    grip: SurfaceGrip = DRY
    weather: tuple[Weather, ...] = ()
    film_mm: Film = 0.0
    stops_when_needed: bool = False
    stop_after: Annotated[int, Field(ge=1, le=MOST_LAPS)] | None = None
    action_hz: Hertz | tuple[Hertz, ...] = float(AGENT_HZ)
    perception_delay_s: Delay | tuple[Delay, ...] = 0.0
    blur: Blur = 0
    noise: Noise = 0.0

    @model_validator(mode="after")
    def _consistent(self) -> Scenario:
        if self.laps is not None and self.finish_m is not None:
            raise ValueError("laps and finish_m exclude each other")
        if self.stops_when_needed and self.stop_after is not None:
            raise ValueError("stops_when_needed and stop_after exclude each other")
        if self.film_mm > 0.0 and not self.weather:
            raise ValueError("film_mm is given, expected weather beside it")
        if isinstance(self.start, FrozenStart) and len(self.start.car) != self.cars:
            raise ValueError(f"start.car has {len(self.start.car)} cars, expected {self.cars}")
        for name in ("action_hz", "perception_delay_s"):
            value = getattr(self, name)
            if isinstance(value, tuple) and len(value) != self.cars:
                raise ValueError(f"{name} must be one number, or {self.cars}, one for each car")
        return self

    def world(self, track: Track, car: Car | Sequence[Car], races: int, threads: int = 1) -> World:
        """Races of the scenario with cars of a model, or of several, yet to be started.

        Raises:
            InputError: if its rules or compound are unknown.
        """
        conditions = Conditions(
            self.compound, self.wear_rate, self.fuel_rate, self.grip, self.weather, self.film_mm
        )
        return World(track, car, races, self.cars, conditions, load_rules(self.rules), threads)

    @property
    def reaction(self) -> Reaction:
        """How often its cars act and how late they see."""
        return Reaction.of(
            np.broadcast_to(np.array(self.action_hz), self.cars),
            np.broadcast_to(np.array(self.perception_delay_s), self.cars),
            Haze(self.blur, self.noise),
        )

    def place(self, track: Track, rng: np.random.Generator) -> Start:
        """Starting places of all cars, first to last, and the weather that comes.

        Raises:
            InputError: if the circuit lacks the section of the scenario's origin.
        """
        match self.start:
            case GridStart():
                start = self._grid(self.start, track, rng)
            case RollingStart():
                start = self._rolling(self.start, track, rng)
            case FormationStart():
                start = self._formation(self.start, track, rng)
            case AbreastStart():
                start = self._abreast(self.start, track, rng)
            case AnywhereStart():
                start = self._anywhere(self.start, track, rng)
            case FrozenStart():
                start = self._frozen(self.start, track, rng)
        return replace(start, sky=draw(self.weather, rng))

    def _finish(self, track: Track) -> np.ndarray:
        if self.laps is not None:
            finish = self.laps * track.length
        elif self.finish_m is None:
            finish = np.inf
        else:
            finish = self.finish_m + (track.stretch(self.origin)[1] if self.origin else 0.0)
        return np.full(self.cars, finish)

    def _formation(self, start: FormationStart, track: Track, rng: np.random.Generator) -> Start:
        places = np.arange(self.cars)
        jitter = start.jitter_m * rng.uniform(-1.0, 1.0, (2, self.cars)) if start.jitter_m else np.zeros(2)
        return Start(
            distance=start.leader_m - start.gap_m * places + jitter[0],
            lateral=np.where(places % 2 == 0, track.grid.lateral_m, -track.grid.lateral_m) + jitter[1],
            heading=np.zeros(self.cars),
            speed=np.full(self.cars, start.speed_m_s),
            finish=self._finish(track),
        )

    def _grid(self, start: GridStart, track: Track, rng: np.random.Generator) -> Start:
        places = np.arange(self.cars)
        jitter = rng.uniform(-start.jitter_m, start.jitter_m, (2, self.cars))
        grid = track.grid
        return Start(
            distance=grid.pole_m - grid.spacing_m * places + jitter[0],
            lateral=np.where(places % 2 == 0, grid.lateral_m, -grid.lateral_m) + jitter[1],
            heading=np.zeros(self.cars),
            speed=np.zeros(self.cars),
            finish=self._finish(track),
        )

    def _rolling(self, start: RollingStart, track: Track, rng: np.random.Generator) -> Start:
        gaps = np.concatenate([[0.0], rng.uniform(*start.gap_m, self.cars - 1)])
        origin = track.stretch(self.origin)[0] if self.origin else 0.0
        leader = origin + rng.uniform(*start.leader_m)
        lateral = rng.uniform(*start.lateral_m, self.cars)
        heading = np.zeros(self.cars)
        speed = np.full(self.cars, rng.uniform(*start.speed_m_s))
        if start.closing_m_s:
            speed[1:] += np.cumsum(rng.uniform(*start.closing_m_s, self.cars - 1))
        if start.stopped:
            gaps[1:2] = rng.uniform(*start.stopped.gap_m)
            lateral[0] = rng.uniform(*start.stopped.lateral_m)
            heading[0] = rng.uniform(*start.stopped.heading_rad)
            speed[0] = 0.0
        return Start(leader - np.cumsum(gaps), lateral, heading, speed, self._finish(track))

    def _abreast(self, start: AbreastStart, track: Track, rng: np.random.Generator) -> Start:
        behind = np.concatenate([[0.0], rng.uniform(*start.behind_m, self.cars - 1)])
        end = track.stretch(self.origin)[1] if self.origin else 0.0
        side = rng.choice([-1.0, 1.0])
        return Start(
            distance=end - rng.uniform(*start.before_end_m) - np.cumsum(behind),
            lateral=side * start.apart_m * (np.arange(self.cars) - 0.5 * (self.cars - 1)),
            heading=np.zeros(self.cars),
            speed=np.full(self.cars, rng.uniform(*start.speed_m_s)),
            finish=self._finish(track),
        )

    def _anywhere(self, start: AnywhereStart, track: Track, rng: np.random.Generator) -> Start:
        gaps = np.concatenate([[0.0], rng.uniform(*start.gap_m, self.cars - 1)])
        distance = rng.uniform(0.0, track.length) - np.cumsum(gaps)
        row = (np.mod(distance, track.length) / track.spacing).astype(np.int64) % len(track.table)
        window = np.arange(round(LOOK_AHEAD_M / track.spacing))
        bend = np.abs(track.table[(row[:, None] + window) % len(track.table), CURVATURE]).max(axis=1)
        fastest = min(55.0, np.sqrt(SAFE_LATERAL / bend.max()))
        edge = np.stack([-track.table[row, RIGHT], track.table[row, LEFT]])
        lateral = rng.uniform(edge[0] + 1.2, edge[1] - 1.2)
        speed = np.full(self.cars, rng.uniform(0.0, fastest))
        heading = rng.normal(0.0, 0.04, self.cars)
        if rng.uniform() < start.beside_share:
            heading[0] = rng.uniform(-0.8, 0.8)
            beside = rng.choice(edge[:, 0] + np.array([-4.0, 4.0]))
            lateral[0] = _off_the_walls(beside, heading[0], track, int(row[0]))
            speed[0] = rng.uniform(0.0, 12.0)
        if start.spun_share and rng.uniform() < start.spun_share:
            heading[0] = rng.uniform(-np.pi, np.pi)
            right, left = track.table[row[0], [WALL_RIGHT, WALL_LEFT]]
            aside = rng.uniform(-right, left)
            lateral[0] = _off_the_walls(aside, heading[0], track, int(row[0]))
            speed[0] = 0.0
        return Start(distance, lateral, heading, speed, self._finish(track))

    def _frozen(self, start: FrozenStart, track: Track, rng: np.random.Generator) -> Start:
        jitter = rng.uniform(-1.0, 1.0, (3, self.cars))

        def of(field: str) -> np.ndarray:
            return np.array([getattr(car, field) for car in start.car], np.float64)

        return Start(
            distance=of("progress_m") + start.jitter_m * jitter[0],
            lateral=of("lateral_m") + start.jitter_m * jitter[1],
            heading=of("heading_rad"),
            speed=of("speed_m_s") + start.jitter_m_s * jitter[2],
            finish=self._finish(track),
            side_speed=of("side_speed_m_s"),
            yaw_rate=of("yaw_rate_rad_s"),
        )


def _off_the_walls(lateral: float, heading: float, track: Track, row: int) -> float:
    """The nearest place beside the centre line, m to its left, at which a car so turned touches no wall."""
    half = 0.5 * (LENGTH_M * abs(np.sin(heading)) + WIDTH_M * abs(np.cos(heading)))
    walls = track.table[(row + np.arange(-2, 3)) % len(track.table)][:, [WALL_RIGHT, WALL_LEFT]]
    room = (walls.min(axis=0) - half) * (-1.0, 1.0)
    return float(np.clip(lateral, *room))


SETTINGS = "laps, cars, person, compound, rules, delay, grip, rain, hours, hz, blur, noise"
"""What may stand behind the name of a scenario, as in `race:laps=4,compound=racing-soft,grip=0.65`."""


@lru_cache
def load_scenario(name: str) -> Scenario:
    """A scenario by its shipped name, or by the path of a `.toml` file, with settings instead of its own.

    With other laps its time changes in proportion; hours are until a race ends that is not driven in laps;
    cars are how many start; a person sits in that place, from 1, and acts in every dynamics step; a compound
    is that of all cars, and a delay, s, that with which all of them see; rules are the stewards'; a grip is a
    multiple of that of every surface when dry, rain a share of what falls and lies; hz is how often all cars
    act a second; blur and noise are of all cameras.

    Raises:
        InputError: if there is no such scenario, its file is wrong, or a setting cannot be.
    """
    file, _, given = name.rpartition(":")
    if not file or "=" not in given:
        file, given = name, ""
    scenario = read_toml(find_data(file, "scenario", DATA / "scenarios"), Scenario, "scenario")
    for key, value in settings_of(given, f"scenario {name!r}"):
        scenario = scenario.model_copy(update=_setting(name, scenario, key, value))
    return scenario


def _setting(name: str, scenario: Scenario, key: str, value: str) -> dict[str, Any]:
    """What changes in a scenario with a setting."""
    match key:
        case "laps":
            return _other_laps(name, scenario, value)
        case "hours":
            return {"time_s": _hours(name, scenario, value)}
        case "cars":
            return {"cars": _cars(name, scenario, value)}
        case "person":
            return {"action_hz": _person(name, scenario, value)}
        case "compound":
            return {"compound": _compound(name, value)}
        case "rules":
            load_rules(value)
            return {"rules": value}
        case "delay":
            seconds = _number(name, "delay", value, Delay, f"seconds from 0 to {LONGEST_DELAY_S}")
            return {"perception_delay_s": seconds}
        case "grip":
            return {"grip": _grip(name, value)}
        case "rain":
            share = _number(name, "rain", value, Annotated[float, Field(ge=0, le=1)], "a share from 0 to 1")
            less = tuple(one.with_share(share) for one in scenario.weather)
            return {"weather": less, "film_mm": share * scenario.film_mm}
        case "hz":
            rates = f"actions a second that divide {DYNAMICS_HZ}"
            return {"action_hz": _number(name, "hz", value, Hertz, rates)}
        case "blur":
            return {"blur": int(_number(name, "blur", value, Blur, f"a number from 0 to {MOST_BLUR}"))}
        case "noise":
            return {"noise": _number(name, "noise", value, Noise, f"a deviation from 0 to {MOST_NOISE:g}")}
    raise InputError(f"scenario {name!r}: unknown setting {key!r}, expected one of {SETTINGS}")


def _other_laps(name: str, scenario: Scenario, laps: str) -> dict[str, float]:
    """What changes in a scenario with other laps."""
    number = _whole(name, "laps", laps, MOST_LAPS)
    if scenario.laps is None:
        raise InputError(f"scenario {name!r}: {scenario.name} is not driven in laps, expected one that is")
    time_s = scenario.time_s * number / scenario.laps
    if time_s > LONGEST_S:
        raise InputError(f"scenario {name!r}: takes {time_s:.0f} s, expected at most {LONGEST_S:.0f} s")
    return {"laps": number, "time_s": time_s}


def _hours(name: str, scenario: Scenario, hours: str) -> float:
    """How long a race lasts, s, in whole seconds."""
    if scenario.laps is not None or scenario.finish_m is not None:
        raise InputError(f"scenario {name!r}: {scenario.name} ends at a line, expected one that ends by time")
    most = LONGEST_S / 3600.0
    kind = Annotated[float, Field(ge=1.0 / 60.0, le=most)]
    return round(3600.0 * _number(name, "hours", hours, kind, f"hours from 1/60 to {most:g}"))


def _cars(name: str, scenario: Scenario, cars: str) -> int:
    each = isinstance(scenario.start, FrozenStart) or any(
        isinstance(value, tuple) for value in (scenario.action_hz, scenario.perception_delay_s)
    )
    if each:
        raise InputError(f"scenario {name!r}: says of each car what it does, expected no setting cars")
    return _whole(name, "cars", cars, MOST_CARS)


def _person(name: str, scenario: Scenario, place: str) -> tuple[float, ...]:
    """Actions a second of each car, with a person in one of the places."""
    rates = np.broadcast_to(np.array(scenario.action_hz), scenario.cars).tolist()
    rates[_whole(name, "person", place, scenario.cars) - 1] = float(DYNAMICS_HZ)
    return tuple(rates)


def _whole(name: str, key: str, value: str, most: int) -> int:
    # Python reads no number of thousands of digits.
    if not value.isdecimal() or len(value) > 9 or not 1 <= int(value) <= most:
        raise InputError(f"scenario {name!r}: {key} is {value!r}, expected a number from 1 to {most}")
    return int(value)


def _compound(name: str, compound: str) -> str:
    if compound not in load_compounds():
        known = ", ".join(load_compounds())
        raise InputError(f"scenario {name!r}: compound {compound!r} is unknown, expected one of {known}")
    return compound


def _grip(name: str, grip: str) -> SurfaceGrip:
    least, most = GRIP
    multiple = _number(name, "grip", grip, Multiple, f"a multiple from {least} to {most}")
    return SurfaceGrip(tarmac=multiple, kerb=multiple, grass=multiple, gravel=multiple)


def _number(name: str, key: str, value: str, kind: Any, expected: str) -> float:
    try:
        return float(TypeAdapter(kind).validate_python(value))
    except ValidationError:
        raise InputError(f"scenario {name!r}: {key} is {value!r}, expected {expected}") from None
