"""The second stage: survivors of the filter through every skill test."""

from __future__ import annotations

import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import polars as pl
from pydantic import Field

from nathlon.arena.entrance import check_opponents
from nathlon.arena.entrant import Entrant, enter
from nathlon.arena.match import Match
from nathlon.arena.results import RESULTS
from nathlon.n_athlon.battery import MARKS, rank_battery, skills
from nathlon.n_athlon.skill import Marks, Skill, load_skills
from nathlon.policies.sources import DRIVER
from nathlon.selection.run import Answer, Run
from nathlon.selection.trials import against, draw_seeds
from nathlon.sim.data_file import Section
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track

DECATHLON = (
    "hot_lap",
    "consistency",
    "delayed_lap",
    "start_front",
    "start_middle",
    "start_back",
    "pass_left",
    "pass_right",
    "chicane_in_traffic",
    "braking_duel",
    "defending",
    "following",
    "emergency",
    "race_craft",
)

MARKS_SEEDS = np.random.SeedSequence(500)
"""Of the built-in driver's runs that set the marks: the same every night."""
MARKS_RUNS = 16


class BatterySettings(Section):
    """The n-athlon.

    Attributes:
        tests: shipped names, or paths of `.toml` files.
        runs: of an entrant in every test, in place of the number that the test asks for.
    """

    tests: Annotated[tuple[str, ...], Field(min_length=1)] = DECATHLON
    runs: Annotated[int, Field(ge=1, le=1000)] | None = None


@dataclass(frozen=True)
class BatteryAnswer(Answer):
    """What the n-athlon found out.

    Attributes:
        marks: what was worth how much, by test.
        set_aside: tests that could not be held here, and why.
    """

    marks: dict[str, Marks]
    set_aside: dict[str, str]


def run_battery(run: Run, entrants: Sequence[Entrant], settings: BatterySettings) -> BatteryAnswer:
    """Test all entrants, all on one circuit, and put them in the order of their points.

    The built-in driver goes through the same tests, with seeds of its own, and sets the marks.

    Raises:
        InputError: if a test is unknown or its file is wrong.
    """
    began = time.perf_counter()
    tests = load_skills(settings.tests)
    if not entrants:
        run.note("battery", 0, 0, pl.DataFrame(schema=RESULTS), began)
        return BatteryAnswer(_tables(run, []), [], pl.DataFrame(schema=RESULTS), {}, {})
    circuit, car = entrants[0].circuit, entrants[0].car
    set_aside = _without_room(tests, circuit)
    held = [skill for skill in tests if skill.name not in set_aside]
    for skill in held:
        check_opponents(run.pool, skill.opponents, circuit, car, f"test {skill.name!r}: field opponents")
    own = marking_matches(held, circuit, car)
    planned = skill_matches(entrants, held, run.seeds("battery"), settings.runs)
    results = run.results("battery", [*own.values(), *planned.values()])
    frames = {str(key): frame for (key,), frame in results.partition_by("match", as_dict=True).items()}

    marks: dict[str, Marks] = {}
    scored: list[pl.DataFrame] = []
    for skill in held:
        found = skill.marks(skill.runs_of(frames[own[skill.name].key]))
        if found is None:
            set_aside[skill.name] = "the built-in driver fails in too many of its runs"
            continue
        marks[skill.name] = found
        for entrant in entrants:
            runs = skill.runs_of(frames[planned[skill.name, entrant.id].key])
            scored.append(skill.table(entrant.id, runs, found))
    tables = _tables(run, scored)
    by_id = {entrant.id: entrant for entrant in entrants}
    ordered = [by_id[entrant] for entrant in tables["battery"]["entrant"]]
    run.note("battery", len(entrants), len(ordered), results, began)
    return BatteryAnswer(tables, ordered, results, marks, set_aside)


def _tables(run: Run, scored: Sequence[pl.DataFrame]) -> dict[str, pl.DataFrame]:
    marks = pl.concat([pl.DataFrame(schema=MARKS), *scored])
    return {
        "skills": skills(marks, run.rng("battery")),
        "battery": rank_battery(marks, run.rng("battery")),
    }


def _without_room(tests: Sequence[Skill], circuit: str) -> dict[str, str]:
    """The tests that need a section which the circuit lacks, with what is said about it."""
    lacking: dict[str, str] = {}
    for skill in tests:
        try:
            load_scenario(skill.scenario).place(load_track(circuit), np.random.default_rng(0))
        except InputError as error:
            lacking[skill.name] = str(error)
    return lacking


def marking_matches(tests: Sequence[Skill], circuit: str, car: str) -> dict[str, Match]:
    """By test, the runs of the built-in driver that set its marks."""
    driver = enter(DRIVER, circuit, car)
    alike = [skill.model_copy(update={"scenario": skill.scenarios[1]}) for skill in tests]
    matches = skill_matches([driver], alike, MARKS_SEEDS, MARKS_RUNS)
    return {test: match for (test, _), match in matches.items()}


def skill_matches(
    entrants: Sequence[Entrant],
    tests: Sequence[Skill],
    seeds: np.random.SeedSequence,
    runs: int | None = None,
) -> dict[tuple[str, str], Match]:
    """Every entrant through every test, by test and entrant.

    All entrants get the same seeds, which depend on the scenario but not on the other tests; tests that
    ask for the same runs share a match.
    """
    matches = {}
    for skill in tests:
        stream = np.random.SeedSequence(seeds.entropy, spawn_key=(zlib.crc32(skill.scenario.encode()),))
        drawn = draw_seeds(stream, runs or skill.runs)
        for entrant in entrants:
            matches[skill.name, entrant.id] = against(
                "battery", skill.scenario, skill.scenario, entrant, skill.opponents, skill.slots, drawn
            )
    return matches
