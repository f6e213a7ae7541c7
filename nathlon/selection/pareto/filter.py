"""The first stage: thousands of checkpoints race the same opponents and the clock, and tens survive."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Annotated

import numpy as np
import polars as pl
from numpy.typing import NDArray
from pydantic import Field, model_validator

from nathlon.arena.entrance import check_opponents
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match
from nathlon.arena.results import RESULTS
from nathlon.arena.statistics import Floats
from nathlon.arena.voids import not_judged_by_tests
from nathlon.arena.world import World
from nathlon.arena.world_registry import home
from nathlon.selection.pareto import STANDARD, came_through, in_contention, pareto
from nathlon.selection.pareto.objective import OWN, RACE, TIME_TRIAL, Objective, objectives_table, own_runs
from nathlon.selection.run import Answer, Run
from nathlon.selection.trials import against, draw_seeds
from nathlon.sim.data_file import Named, Section
from nathlon.sim.errors import InputError

Share = Annotated[float, Field(ge=0, le=1)]

SETTLED = 0.95
"""An entrant this likely to be on the front survives; more races would not change that."""


class FilterSettings(Section):
    """How checkpoints are filtered.

    Attributes:
        scenario: what everybody races.
        slots: starting places of whoever is filtered, in turn; the last one if none are given.
        opponents: who starts from the other places, in turn.
        time_trial: what everybody drives alone; None where nobody does.
        races: of the first round, and as many time trials; every further round doubles their sum.
        most_races: beyond which nobody has any more.
        keep_probability: to be non-dominated, from which on one survives.
        resamples: draws of which it is the share.
        objective: by which one dominates another.
    """

    scenario: str = "sprint"
    opponents: Annotated[tuple[Named, ...], Field(min_length=1)] = (
        "driver:pace=0.88",
        "driver:pace=0.93",
        "driver:pace=0.98",
    )
    slots: tuple[Annotated[int, Field(ge=1)], ...] = ()
    time_trial: str | None = "time_trial"
    races: Annotated[int, Field(ge=1, le=1000)] = 2
    most_races: Annotated[int, Field(ge=1, le=1000)] = 8
    keep_probability: Share = 0.05
    resamples: Annotated[int, Field(ge=20, le=100_000)] = 500
    objective: Annotated[tuple[Objective, ...], Field(min_length=1)] = STANDARD

    @model_validator(mode="after")
    def _consistent(self) -> FilterSettings:
        names = [objective.name for objective in self.objective]
        if len(set(names)) < len(names):
            raise ValueError("objective: expected a different name for each")
        if self.most_races < self.races:
            raise ValueError(f"most_races is {self.most_races}: expected at least races, {self.races}")
        return self

    @property
    def rounds(self) -> list[int]:
        """Races of each round."""
        rounds = [self.races]
        while sum(rounds) < self.most_races:
            rounds.append(min(sum(rounds), self.most_races - sum(rounds)))
        return rounds


class FilterPlan:
    """The matches of each round; all entrants have the same seeds in it, and slots go on in turn."""

    def __init__(self, settings: FilterSettings, world: World, seeds: np.random.SeedSequence) -> None:
        """The plan of a filter in a world, whose seeds all come from `seeds`."""
        self._settings = settings
        self._slots = settings.slots or (len(world.setup(settings.scenario).sides),)
        self._needs_races = any(objective.source == RACE for objective in settings.objective)
        streams = seeds.spawn(2 * len(settings.rounds))
        drawn = [draw_seeds(s, n) for s, n in zip(streams, np.repeat(settings.rounds, 2), strict=True)]
        self._trial_seeds, self._race_seeds = drawn[::2], drawn[1::2]

    def time_trials(self, entrants: Sequence[Entrant], index: int) -> list[Match]:
        """The time trials of a round; none where there are none."""
        if self._settings.time_trial is None:
            return []
        scenario, seeds = self._settings.time_trial, self._trial_seeds[index]
        return [against("pareto", TIME_TRIAL, scenario, entrant, [], [1], seeds) for entrant in entrants]

    def races(self, entrants: Sequence[Entrant], index: int) -> list[Match]:
        """The races of a round; none if no objective asks for them."""
        if not self._needs_races:
            return []
        scenario, opponents = self._settings.scenario, self._settings.opponents
        seeds, before = self._race_seeds[index], sum(self._settings.rounds[:index])
        return [
            against("pareto", RACE, scenario, entrant, opponents, self._slots, seeds, before=before)
            for entrant in entrants
        ]

    def next_rounds(self, entrants: Sequence[Entrant], driven: dict[str, int]) -> Iterator[Match]:
        """Everything of the round that comes next for each entrant, by the rounds that it has driven."""
        for entrant in entrants:
            yield from self.time_trials([entrant], driven[entrant.id])
            yield from self.races([entrant], driven[entrant.id])


def run_filter(run: Run, entrants: Sequence[Entrant], settings: FilterSettings) -> Answer:
    """Filter entrants: keep those that may be on the Pareto front.

    Everybody drives the time trials of the first round, and whoever comes through races. Whoever may
    then be on the front goes on to its next round, until nobody is in contention who has rounds left
    and is not settled. Who drives what depends on results alone, so that a run that was stopped goes
    on as it would have.

    Raises:
        InputError: if a scenario or an opponent is unknown, or a scenario does not fit.
    """
    began = time.perf_counter()
    if not entrants:
        raise InputError("no checkpoint given, expected at least one")
    world = home(entrants[0])
    _check(settings, world)
    check_opponents(run.pool, settings.opponents, entrants[0], "field pareto.opponents")
    plan = FilterPlan(settings, world, run.seeds("pareto"))
    results = [pl.DataFrame(schema=RESULTS), run.results("pareto", plan.time_trials(entrants, 0))]
    racing = list(entrants)
    if settings.time_trial is not None:
        through = came_through(own_runs(results[-1]), TIME_TRIAL)
        racing = [entrant for entrant in entrants if entrant.id in through]
    results.append(run.results("pareto", plan.races(racing, 0)))
    driven = {entrant.id: 1 for entrant in racing}
    while True:
        known = pl.concat(results)
        table = pareto(
            known, settings.objective, run.rng("pareto"), settings.resamples, settings.keep_probability
        )
        open_ = undecided(table["nondominated_probability"].to_numpy())
        contenders = set(table.filter(pl.Series(open_))["entrant"])
        again = [e for e in racing if e.id in contenders and driven[e.id] < len(settings.rounds)]
        if not again:
            break
        results.append(run.results("pareto", list(plan.next_rounds(again, driven))))
        driven |= {entrant.id: driven[entrant.id] + 1 for entrant in again}
    kept = set(table.filter("survives")["entrant"])
    survivors = [entrant for entrant in entrants if entrant.id in kept]
    run.note("pareto", len(entrants), len(survivors), known, began)
    tables = {"pareto": table, "objectives": objectives_table(known, settings.objective, world.measures)}
    return Answer(tables, survivors, known, not_judged_by_tests(known))


def undecided(probability: Floats) -> NDArray[np.bool_]:
    """Who of E is in contention for the front and not settled, by the probability (E,) to be on it."""
    return in_contention(probability) & (probability < SETTLED)


def _check(settings: FilterSettings, world: World) -> None:
    for field in ("scenario", "time_trial"):
        name = getattr(settings, field)
        if name is not None and not world.setup(name).ends:
            raise InputError(f"field pareto.{field} is {name!r}: expected a scenario with laps or finish_m")
    for objective in settings.objective:
        name = objective.measure.removeprefix(OWN)
        if name != objective.measure and name not in world.measures:
            raise InputError(
                f"field pareto.objective has the measure {objective.measure!r}: expected one that "
                f"world {world.name!r} declares, of {', '.join(world.measures) or 'none'}"
            )
    places = len(world.setup(settings.scenario).sides)
    if max(settings.slots, default=1) > places:
        raise InputError(f"field pareto.slots is {list(settings.slots)}: expected places from 1 to {places}")
    if settings.time_trial is None:
        return
    cars = len(world.setup(settings.time_trial).seats)
    if cars != 1:
        raise InputError(
            f"field pareto.time_trial is {settings.time_trial!r} with {cars} cars: expected one of one car"
        )
