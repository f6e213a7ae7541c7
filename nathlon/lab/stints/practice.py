"""Practice: a policy drives alone on tyres that wear, and every lap is kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import polars as pl

from nathlon.arena.job import Opening
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool, quietly
from nathlon.arena.runner import run_match
from nathlon.policies.load import load_policy
from nathlon.policies.sources.composite import Composite, CompositePart
from nathlon.policies.stint_search import SPARE_KG
from nathlon.policies.strategy import Stint, StintPlan
from nathlon.sim.errors import InputError
from nathlon.sim.names import settings_of
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from nathlon.sim.world import World

MOST_STINT_LAPS = 20
"""Laps of a practice stint, at most."""
LEAST_LAPS = 2
"""A run of which less is known, as the car did not come round, tells nothing."""

LAPS = pl.Schema(
    {
        "compound": pl.String,
        "run": pl.Int64,
        "start": pl.Boolean,  # whether it is the first from the start
        "age": pl.Int64,  # laps on these tyres, this one counted
        "stops": pl.Boolean,  # whether the lap after a stop at its end is part of it
        "fuel_kg": pl.Float64,  # when it began; of two laps the sum
        "used_kg": pl.Float64,  # in the first lap; nothing is known where it was filled in
        "wear": pl.Float64,  # of the tyres at its end, mean of the four; 1 is worn out
        "lap_s": pl.Float64,  # without the service
    }
)
LapRow = tuple[str, int, bool, int, bool, float, float, float, float]
"""A row of LAPS."""


class Practice(NamedTuple):
    """One run to practise.

    Attributes:
        source: of the policy.
        scenario, circuit, car: where; the scenario with one car.
        stints: on the same compound.
        seed: of its start.
    """

    source: str
    scenario: str
    circuit: str
    car: str
    stints: tuple[Stint, ...]
    seed: int


class Place(NamedTuple):
    """Where a policy practises: names of a scenario with one car, of the circuit and of the car."""

    scenario: str
    circuit: str
    car: str

    @classmethod
    def alone(cls, scenario: str, circuit: str, car: str) -> Place:
        """In a scenario, but alone and in the dry.

        Raises:
            InputError: if it is not driven in two laps or more, or nothing wears in it.
        """
        wanted = load_scenario(scenario)
        if wanted.laps is None or wanted.laps < 2 or wanted.wear_rate == 0.0:
            raise InputError(
                f"scenario {scenario!r}: laps is {wanted.laps}, wear_rate {wanted.wear_rate:g}, "
                "expected a race of two laps or more on tyres that wear"
            )
        laps = min(wanted.laps, MOST_STINT_LAPS)
        settings = {"cars": 1, "laps": laps} | ({"rain": 0} if wanted.weather else {})
        return cls(with_settings(scenario, **settings), circuit, car)

    @property
    def laps(self) -> int:
        """Laps of a run."""
        return load_scenario(self.scenario).laps or 0


def heavy(source: str, place: Place, compounds: Sequence[str], runs: int, seed: int) -> list[Practice]:
    """Runs with a full tank and no stop, so many on each compound."""
    return [
        Practice(source, *place, (Stint(laps=place.laps, compound=compound),), seed + run)
        for compound in compounds
        for run in range(runs)
    ]


def light(source: str, place: Place, driven: pl.DataFrame, runs: int, seed: int) -> list[Practice]:
    """Runs with a stop half-way and no more fuel than each half needs, so many on each compound.

    Laps on old tyres are those of a light car as well: only runs that begin with other tanks tell the two
    apart. What a stop loses shows where the lap before it was also driven without one. Where tyres gave up
    before the end of the race, half-way is half of what they lasted.

    Args:
        source, place: as for `heavy`.
        driven: LAPS of the heavy runs, which say how much fuel laps take.
        runs, seed: as for `heavy`.
    """
    asked = []
    for compound in driven["compound"].unique(maintain_order=True):
        laps = driven.filter(pl.col("compound") == compound)
        lasted = int(laps["age"].max())  # type: ignore[arg-type]
        lengths = lasted // 2, lasted - lasted // 2
        stints = tuple(
            Stint(
                laps=length,
                compound=compound,
                fuel_kg=float(laps.filter(pl.col("age") <= length)["used_kg"].mean() or 0.0) * length  # type: ignore[arg-type]
                + SPARE_KG,
            )
            for length in lengths
        )
        asked += [Practice(source, *place, stints, seed + run) for run in range(runs)]
    return asked


def with_settings(scenario: str, **settings: float) -> str:
    """The name of a scenario with some settings instead of its own.

    Raises:
        InputError: if one cannot be.
    """
    file, _, given = scenario.rpartition(":")
    if not file or "=" not in given:
        file, given = scenario, ""
    kept = dict(settings_of(given, f"scenario {scenario!r}")) | {
        key: f"{n:.12g}" for key, n in settings.items()
    }
    name = f"{file}:{','.join(f'{key}={value}' for key, value in kept.items())}"
    load_scenario(name)
    return name


def practise(
    pool: Pool, asked: Sequence[Practice], on_driven: Callable[[int, int], None] = quietly
) -> pl.DataFrame:
    """Drive practice runs; LAPS of them all.

    Args:
        pool: where policies run.
        asked: the runs, of one policy in one place.
        on_driven: told how many are done, of how many.

    Raises:
        InputError: if the policy cannot drive, or comes round on none of the tyres.
    """
    on_driven(0, 1)
    [answer] = pool.open([Opening(asked[0].source, drive, (tuple(asked),))], on_driven)
    if isinstance(answer, InputError):
        raise answer
    frames = [
        pl.DataFrame(rows, schema=LAPS, orient="row").with_columns(run=pl.lit(run))
        for run, rows in enumerate(answer)
        if len(rows) >= LEAST_LAPS
    ]
    if not frames:
        raise InputError(f"{asked[0].source}: did not come round {LEAST_LAPS} times on any of its tyres")
    return pl.concat(frames)


def drive(asked: Sequence[Practice]) -> list[list[LapRow]]:
    """Drive practice runs of one policy in one place, side by side in one world; rows of LAPS of each."""
    first = asked[0]
    policy = load_policy(first.source, first.circuit, first.car)
    track, part = load_track(first.circuit), CompositePart(policy=first.source)
    planned = [
        Composite(track, [part], [policy], policy.observation_spec, StintPlan(one.stints)) for one in asked
    ]
    names, sources = tuple(f"run {run}" for run in range(len(asked))), (first.source,) * len(asked)
    races = tuple(Race(one.seed, (Seat(run),)) for run, one in enumerate(asked))
    match = Match("race", "practice", first.scenario, first.circuit, first.car, names, sources, races)
    begun: list[list[_Begin]] = [[] for _ in asked]
    stood_s = np.zeros(len(asked))

    def look(world: World) -> None:
        state = world.state[:, 0]
        stood_s[:] = state["stood_s"]
        for run in np.flatnonzero((state["progress"] >= 0.0) & (state["laps"] == list(map(len, begun)))):
            car = state[run]
            line_s, fuel_kg, wear = float(car["line_s"][0]), float(car["fuel"]), float(car["wear"].mean())
            begun[run].append(_Begin(line_s, fuel_kg, wear, int(car["stops"]), int(car["missed"])))

    run_match(match, planned, look)
    return [
        _rows(str(one.stints[0].compound), one.stints[0].laps, laps, stood)
        for one, laps, stood in zip(asked, begun, stood_s.tolist(), strict=True)
    ]


class _Begin(NamedTuple):
    """When a lap began, with how much fuel, mean wear of the tyres, after how many stops, and missed ones."""

    time_s: float
    fuel_kg: float
    wear: float
    stops: int
    missed: int


def _rows(compound: str, stop: int, begun: Sequence[_Begin], stood_s: float) -> list[LapRow]:
    """Those of a run until its tank was empty; the laps before and after its stop together, wherever the line
    lies.

    Raises:
        InputError: if it came to the pit lane too fast and stopped a lap late: no row tells of that.
    """
    if begun and begun[-1].missed:
        raise InputError(
            f"a practice run on {compound} came to the pit lane too fast, "
            "expected a stop in the lap that was asked for"
        )
    rows: list[LapRow] = []
    first, age = 0, 1
    while first < len(begun) - 1:
        stops = age == stop and first + 2 < len(begun) and begun[first + 2].stops > begun[first].stops
        last = first + 2 if stops else first + 1
        begin, end = begun[first], begun[last]
        if end.fuel_kg <= 0.0:
            break
        taken = end.time_s - begin.time_s - (stood_s if stops else 0.0)
        fuel_kg = sum(each.fuel_kg for each in begun[first:last])
        used_kg = begun[first].fuel_kg - begun[first + 1].fuel_kg
        rows.append((compound, 0, first == 0, age, stops, fuel_kg, used_kg, end.wear, taken))
        first, age = last, 2 if stops else age + 1
    return rows
