"""The second stage: survivors of the filter through every skill test."""

from __future__ import annotations

import time
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import polars as pl
from pydantic import Field

from nathlon.arena.entrance import check_opponents
from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match
from nathlon.arena.results import RESULTS
from nathlon.arena.voids import not_judged_by_tests
from nathlon.arena.world import World
from nathlon.arena.world_registry import home
from nathlon.policies.sources import DRIVER
from nathlon.selection.battery.measures import SkillMeasure, measured
from nathlon.selection.battery.place import stretch
from nathlon.selection.battery.ranking import MARKS, rank_battery, skills
from nathlon.selection.battery.skill import Marks, Skill, load_skills, standing_tests
from nathlon.selection.run import Answer, Run
from nathlon.selection.trials import against, draw_seeds
from nathlon.sim.data_file import Section
from nathlon.sim.errors import InputError

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
    "race_with_stop",
)
ON_REQUEST = ("wet_start", "drying_road", "tyre_care", "fuel_saving", "pit_stop")
"""Shipped tests that are held only if they are named."""

MARKS_SEEDS = np.random.SeedSequence(500)
"""Of the built-in driver's runs that set the marks: the same every night."""
MARKS_RUNS = 16


class BatterySettings(Section):
    """The n-athlon.

    Attributes:
        tests: shipped names, or paths of `.toml` files.
        runs: of an entrant in every test, instead of the number that the test asks for.
        incidents: folder of incidents that survivors must pass as well; they bring no points.
    """

    tests: Annotated[tuple[str, ...], Field(min_length=1)] = DECATHLON
    runs: Annotated[int, Field(ge=1, le=1000)] | None = None
    incidents: str | None = None


@dataclass(frozen=True)
class BatteryAnswer(Answer):
    """What the n-athlon found out.

    Attributes:
        marks: what was worth how much, by test.
        set_aside: tests that could not be held here, and why.
        asked: what each of the others asks, for people.
        stretches: where each of them is held; see `nathlon.selection.battery.place.stretch`.
        failed: by test and entrant, how many runs set no mark, where any did.
    """

    marks: dict[str, Marks]
    set_aside: dict[str, str]
    asked: dict[str, str]
    stretches: dict[str, tuple[float, float] | None]
    failed: dict[str, dict[str, int]]


def run_battery(run: Run, entrants: Sequence[Entrant], settings: BatterySettings) -> BatteryAnswer:
    """Test all entrants, all of one world, and put them in the order of their points.

    The built-in driver goes through the same tests, with seeds of its own, and sets the marks.

    Raises:
        InputError: if a test is unknown or its file is wrong.
    """
    began = time.perf_counter()
    if not entrants:
        run.note("battery", 0, 0, pl.DataFrame(schema=RESULTS), began)
        return BatteryAnswer(_tables(run, []), [], pl.DataFrame(schema=RESULTS), [], {}, {}, {}, {}, {})
    world = home(entrants[0])
    tests = load_skills(settings.tests, world) or standing_tests(world)
    set_aside = _without_room(tests, world)
    held = [skill for skill in tests if skill.name not in set_aside]
    for skill in held:
        check_opponents(run.pool, skill.opponents, entrants[0], f"test {skill.name!r}: field opponents")
    sources = [skill.baseline or world.baseline for skill in held]
    check_opponents(run.pool, sources, entrants[0], "field baseline")
    own = marking_matches(held, entrants[0])
    planned = skill_matches(entrants, held, run.seeds("battery"), settings.runs)
    results = run.results("battery", [*own.values(), *planned.values()])
    frames = {str(key): frame for (key,), frame in results.partition_by("match", as_dict=True).items()}

    marks: dict[str, Marks] = {}
    scored: list[pl.DataFrame] = []
    tested: list[pl.DataFrame] = []
    for skill in held:
        how = measured(skill.measure, world)
        setting = frames[own[skill.name].key]
        if not_judged_by_tests(setting):
            set_aside[skill.name] = f"most runs of {_called(skill, world)} are void"
            continue
        found = skill.marks(skill.runs_of(setting, how), how)
        if found is None:
            set_aside[skill.name] = f"{_called(skill, world)} fails in too many of its runs"
            continue
        marks[skill.name] = found
        own_frames = {entrant.id: frames[planned[skill.name, entrant.id].key] for entrant in entrants}
        scored.append(marked(skill, own_frames, found, how))
        tested += [frame.with_columns(test=pl.lit(skill.name)) for frame in own_frames.values()]
    tables = _tables(run, scored)
    by_id = {entrant.id: entrant for entrant in entrants}
    ordered = [by_id[entrant] for entrant in tables["battery"]["entrant"]]
    run.note("battery", len(entrants), len(ordered), results, began)
    not_judged = not_judged_by_tests(pl.concat([pl.DataFrame(schema=RESULTS), *tested]))
    asked = {skill.name: skill.description for skill in held}
    circuit = entrants[0].circuit
    stretches = {skill.name: stretch(skill, circuit) if circuit else None for skill in held}
    failed = {name: _failed(frame) for name, frame in zip(marks, scored, strict=True)}
    return BatteryAnswer(tables, ordered, results, not_judged, marks, set_aside, asked, stretches, failed)


def marked(skill: Skill, frames: Mapping[str, pl.DataFrame], marks: Marks, how: SkillMeasure) -> pl.DataFrame:
    """MARKS of a test, from the RESULTS of every entrant's match."""
    return pl.concat(
        skill.table(entrant, skill.runs_of(frame, how), marks, how.unit) for entrant, frame in frames.items()
    )


def _failed(marks: pl.DataFrame) -> dict[str, int]:
    """From the MARKS of a test: how many runs of an entrant set no mark, of those that have any."""
    unmarked = marks.filter(pl.col("measure").is_null())
    return dict(unmarked.group_by("entrant", maintain_order=True).len().iter_rows())


def _tables(run: Run, scored: Sequence[pl.DataFrame]) -> dict[str, pl.DataFrame]:
    marks = pl.concat([pl.DataFrame(schema=MARKS), *scored])
    return {
        "skills": skills(marks, run.rng("battery")),
        "battery": rank_battery(marks, run.rng("battery")),
    }


def _called(skill: Skill, world: World) -> str:
    """Who sets the marks of a test."""
    source = skill.baseline or world.baseline
    return "the built-in driver" if source == DRIVER else source


def _without_room(tests: Sequence[Skill], world: World) -> dict[str, str]:
    """The tests that the world has no room for, with what is said about it."""
    lacking: dict[str, str] = {}
    for skill in tests:
        try:
            world.check(skill.scenario)
        except InputError as error:
            lacking[skill.name] = str(error)
    return lacking


def marking_matches(tests: Sequence[Skill], beside: Entrant) -> dict[str, Match]:
    """By test, the runs of the built-in driver, or whoever else, that set its marks beside an entrant."""
    world = home(beside)
    matches: dict[tuple[str, str], Match] = {}
    for skill in tests:
        alike = skill.model_copy(update={"scenario": skill.scenarios[1]})
        driver = world.enter(skill.baseline or world.baseline)
        matches |= skill_matches([driver], [alike], MARKS_SEEDS, MARKS_RUNS)
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
        own = zlib.crc32(Path(skill.scenario).name.encode())
        stream = np.random.SeedSequence(seeds.entropy, spawn_key=(own,))
        drawn = draw_seeds(stream, runs or skill.runs)
        for entrant in entrants:
            matches[skill.name, entrant.id] = against(
                "battery",
                skill.scenario,
                skill.scenario,
                entrant,
                skill.opponents,
                skill.slots,
                drawn,
                skill.in_order,
            )
    return matches
