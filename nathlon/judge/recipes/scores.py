"""Racing the checkpoints of recipes against the same references, on the same starts."""

from __future__ import annotations

import zlib
from collections.abc import Container, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match
from nathlon.arena.voids import not_judged_by_meetings, units_met
from nathlon.judge.recipes.grouping import RecipeRun
from nathlon.results.recipes import SCORES
from nathlon.selection.config import Config
from nathlon.selection.round_robin import Fixture, entered_there
from nathlon.selection.run import Run
from nathlon.selection.trials import draw_seeds
from nathlon.sim.errors import InputError
from nathlon.tournament.event import EventRace
from nathlon.tournament.evidence import UNIT, appearances
from nathlon.tournament.schedule import Meeting

STAGE = "recipes"
SEED = 3_141_592
"""Beside the configuration's, so that no race is one of a selection."""


@dataclass(frozen=True)
class Task:
    """A race of an event against a reference.

    Attributes:
        name: of the race, and of the reference where there are several.
        seeds: of its units, the same for all checkpoints.
    """

    name: str
    race: EventRace
    reference: Entrant
    seeds: tuple[int, ...]


def score(
    run: Run, attempts: Sequence[RecipeRun], references: Sequence[Entrant], config: Config
) -> pl.DataFrame:
    """Race every checkpoint of some training runs in every task: SCORES.

    Whoever has most of its units in a race void has no points in it, and nobody has any against such a
    reference.

    Raises:
        InputError: if there is no reference, or nothing that two teams race.
    """
    checkpoints = {one.id: one for attempt in attempts for one in attempt.checkpoints}
    matches = {
        (one, task.name): match
        for task in tasks(run, references, config)
        for one, match in _matches(run, list(checkpoints.values()), task).items()
    }
    results = run.results(STAGE, list(matches.values()))
    not_judged = {(one.entrant, one.test) for one in not_judged_by_meetings(results)}
    frames = {str(key): frame for (key,), frame in results.partition_by("match", as_dict=True).items()}
    rows = [
        {
            "recipe": attempt.recipe,
            "run": attempt.run,
            "step": one.step,
            "entrant": one.id,
            "name": one.name,
            "task": task,
            **_figures(frames[match.key], one.id, not_judged),
        }
        for attempt in attempts
        for one in attempt.checkpoints
        for (entrant, task), match in matches.items()
        if entrant == one.id
    ]
    return pl.DataFrame(rows, schema=SCORES)


def tasks(run: Run, references: Sequence[Entrant], config: Config) -> list[Task]:
    """The races of two teams of the configuration's event, against every reference.

    Raises:
        InputError: if there is none.
    """
    event = config.tournament.held(config.circuit, config.car, config.world)
    raced = [race for race in event.race if race.made.teams]
    if not raced:
        raise InputError("no scenario has two sides, expected one in which a checkpoint meets a reference")
    if not references:
        raise InputError("no reference given, expected policies that all checkpoints race")
    made = []
    for race in raced:
        for reference in references:
            own = zlib.crc32(f"{race.name}\n{reference.id}".encode())
            stream = np.random.SeedSequence([*run.seeds_from, SEED, own])
            seeds = tuple(draw_seeds(stream, race.pairs or config.tournament.pairs))
            name = race.name if len(references) == 1 else f"{race.name}, {reference.name}"
            made.append(Task(name, race, reference, seeds))
    return made


def _matches(run: Run, checkpoints: Sequence[Entrant], task: Task) -> dict[str, Match]:
    """The match of every checkpoint but the reference itself, by their ids."""
    race = task.race
    *field, reference = entered_there(run.pool, [*checkpoints, task.reference], race.circuit, race.car)
    return {
        one.id: Fixture(race, Meeting((one.id, reference.id), task.seeds), (one, reference)).match(
            slice(None), STAGE
        )
        for one in field
        if one.id != reference.id
    }


def _figures(
    results: pl.DataFrame, entrant: str, not_judged: Container[tuple[str, str]]
) -> dict[str, float | int | bool | None]:
    """What a checkpoint made of its units against a reference.

    Args:
        results: RESULTS of their match.
        entrant: id of the checkpoint.
        not_judged: ids of those of whom nothing is said, with the race's name.
    """
    seen = appearances(results)
    points = pl.col("points")
    by_unit = seen.group_by(*UNIT, maintain_order=True).agg(
        gap=points.filter(pl.col("entrant") == entrant).sum()
        - points.filter(pl.col("entrant") != entrant).sum()
    )["gap"]
    met = units_met(results)
    void = met.filter("void").select("match", "run").unique().height
    judged = not any(pair in not_judged for pair in met.select("entrant", "test").unique().iter_rows())
    own = seen.filter(pl.col("entrant") == entrant).sum()
    some = judged and len(by_unit) > 0
    return {
        "units": len(by_unit),
        "void": void,
        "judged": some,
        "points": by_unit.mean() if some else None,
        "error": by_unit.std() / len(by_unit) ** 0.5 if some and len(by_unit) > 1 else None,
        "contacts": own["contacts"].item(),
        "at_fault": own["at_fault"].item(),
        "km": own["km"].item() or None,
    }
