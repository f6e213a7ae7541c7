"""Skill tests: data files that name a scenario, its opponents, a measure and its scoring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import polars as pl
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator
from scipy.optimize import brentq

from nathlon.arena.match import TESTED
from nathlon.arena.results import POLICY_FAULTS, VOID_ENDINGS
from nathlon.arena.tested import entrant_rows
from nathlon.arena.world import KNOWN, World
from nathlon.arena.world_finding import RACING
from nathlon.arena.world_registry import load_world
from nathlon.policies.sources import DRIVER
from nathlon.selection.battery.measures import MEASURES, OWN, SkillMeasure, measured
from nathlon.selection.battery.ranking import MARKS
from nathlon.selection.battery.scoring import BASE_POINTS, Kind, Scoring
from nathlon.sim.data_file import Name, Section, find_data, read_toml
from nathlon.sim.errors import InputError

SKILLS_FOLDER = Path(__file__).parent.parent.parent / "data" / "skills"

RUNS = 8
"""Of an entrant in a test that does not say how many."""

Runs = list[tuple[int, float | None]]
"""Index and mark of each run; None where it set no mark."""


class Gains(Section):
    """What is worth how much, seen from the built-in driver's 500 points.

    Gains are shares of its median mark where that is a time or a way, and in the measure's unit otherwise; or
    in standard deviations of its marks.

    Attributes:
        reference_gain: by which a mark worth 1,000 points is better than one worth 500.
        limit_gain: no mark counts for more than this: what lies beyond owes more to the opponents' accidents
            than to skill, and must not outweigh the other runs.
        exponent: how progressive the points are.
        base: the mark worth 500 points, where it is given and no driver is asked to set it.
        in_deviations: whether gains are in standard deviations of the driver's marks.
    """

    reference_gain: Annotated[float, Field(ge=1e-6, le=1e6)]
    limit_gain: Annotated[float, Field(ge=1e-6, le=1e6)]
    exponent: Annotated[float, Field(ge=0.01, le=100)]
    base: Annotated[float, Field(ge=-1e9, le=1e9)] | None = None
    in_deviations: bool = False

    @model_validator(mode="after")
    def _in_order(self) -> Gains:
        if self.limit_gain < self.reference_gain:
            raise ValueError("limit_gain must not be less than reference_gain")
        return self


class Passed(Section):
    """What counts as passed, where a test is passed or failed.

    Attributes:
        at_most: the mark of a run that is passed, in the unit of a measure of which less is better.
        share: of the runs that an entrant must pass to pass the test.
    """

    at_most: Annotated[float, Field(ge=-1e9, le=1e9)]
    share: Annotated[float, Field(gt=0, le=1)] = 0.9


@dataclass(frozen=True)
class Marks:
    """The marks of a test on some circuit with some car.

    Attributes:
        base, reference: what is worth 500 and 1,000 points.
        limit: no mark counts for more.
        scoring: through the first two.
    """

    base: float
    reference: float
    limit: float
    scoring: Scoring

    @classmethod
    def about(cls, base: float, kind: Kind, gains: Gains, scale: float) -> Marks:
        """The marks with gains on a base, in units of `scale`."""
        better = -scale if kind == "time" else scale
        reference = base + better * gains.reference_gain
        scoring = Scoring.through(kind, base, reference, gains.exponent)
        return cls(base, reference, base + better * gains.limit_gain, scoring)

    def points(self, marks: ArrayLike) -> NDArray[np.float64]:
        """Points of each mark, in the shape of `marks`; NaN, a mark never set, gives 0."""
        marks = np.asarray(marks, dtype=np.float64)
        cap = np.maximum if self.scoring.kind == "time" else np.minimum
        return self.scoring.points(cap(marks, self.limit))


class Skill(Section):
    """One test of the n-athlon.

    Attributes:
        name: unique among the tests.
        description: what it asks, for people.
        scenario: what is driven.
        slots: starting places of the entrant, in turn from run to run.
        opponents: who start from the other places, in turn; on our circuits built-in drivers.
        baseline: source of the policy that sets the marks; the world's own if none is named.
        runs: how often, each with a seed of its own.
        measure: name of a measure, one of `nathlon.selection.battery.measures.MEASURES`.
        marks_scenario: what the built-in driver drives to set the marks, if not the scenario itself.
        contact_penalty: worsens the mark, in its unit, for each contact that the stewards lay to the entrant.
        scoring: what the marks are worth.
        circuit, car: where alone it can be held; None is anywhere.
        in_order: opponents keep their places; otherwise they move on by one from run to run.
        passed: what counts as passed; None where the test is not passed or failed.
    """

    name: Name
    description: str
    scenario: str
    slots: Annotated[tuple[Annotated[int, Field(ge=1)], ...], Field(min_length=1)]
    opponents: tuple[str, ...] = ()
    baseline: str | None = None
    runs: Annotated[int, Field(ge=1, le=1000)] = RUNS
    measure: str
    marks_scenario: str | None = None
    contact_penalty: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    scoring: Gains
    circuit: str | None = None
    car: str | None = None
    in_order: bool = False
    passed: Passed | None = None

    @model_validator(mode="after")
    def _known(self) -> Skill:
        if self.measure not in MEASURES and not self.measure.startswith(OWN):
            raise ValueError(f"measure is {self.measure!r}: expected one of {', '.join(MEASURES)}")
        return self

    @property
    def scenarios(self) -> tuple[str, str]:
        """What an entrant drives, and what the built-in driver drives to set the marks."""
        return self.scenario, self.marks_scenario or self.scenario

    def slot(self, run: int) -> int:
        """The entrant's starting place in a run."""
        return self.slots[run % len(self.slots)]

    def runs_of(self, results: pl.DataFrame, how: SkillMeasure) -> Runs:
        """The marks of an entrant's runs, from the RESULTS of its match; void races are left out."""
        runs: Runs = []
        entrant = {row["race"]: row for row in entrant_rows(results).iter_rows(named=True)}
        for (race,), cars in results.sort("race", "car").group_by("race", maintain_order=True):
            rows = list(cars.iter_rows(named=True))
            if any(row["ending"] in VOID_ENDINGS for row in rows):
                continue
            run = int(str(race))
            own = entrant[run]
            others = [row for row in rows if row["team"] != TESTED]
            mark = None if own["ending"] in POLICY_FAULTS else how.mark(own, others)
            if mark is not None:
                worse = self.contact_penalty * (own["contacts_at_fault"] or 0)
                mark += worse if how.kind == "time" else -worse
            runs.append((run, mark))
        return runs

    def marks(self, driver: Runs, how: SkillMeasure) -> Marks | None:
        """The marks with which the driver's runs average 500 points; None where too many of them fail.

        Where the scoring gives the mark that is worth 500 points, it is that one.

        The points of its median mark would not do: where some runs end in an accident, most are better
        than their mean.
        """
        marks = np.array([np.nan if mark is None else mark for _, mark in driver])
        valid = marks[np.isfinite(marks)]
        if not len(valid) and (self.scoring.base is None or self.scoring.in_deviations):
            return None
        middle = float(np.median(valid)) if self.scoring.base is None else self.scoring.base
        scale = abs(middle) if how.relative else 1.0
        if self.scoring.in_deviations:
            scale = float(valid.std()) or abs(middle) or 1.0

        def about(base: float) -> Marks:
            return Marks.about(base, how.kind, self.scoring, scale)

        def surplus(base: float) -> float:
            return float(about(base).points(marks).mean()) - BASE_POINTS

        if self.scoring.base is not None:
            return about(self.scoring.base)
        # At one end every mark set is worth nothing, at the other as much as any can be.
        reach = abs(about(middle).scoring.threshold - about(middle).limit)
        ends = (float(valid.min()) - reach, float(valid.max()) + reach)
        if max(surplus(end) for end in ends) < 0:
            return None
        return about(float(brentq(surplus, *ends)))

    def table(self, entrant: str, runs: Runs, marks: Marks, unit: str) -> pl.DataFrame:
        """MARKS of an entrant's runs."""
        rows = [
            (
                entrant,
                self.name,
                run,
                mark,
                unit,
                float(marks.points(np.nan if mark is None else mark)),
            )
            for run, mark in runs
        ]
        return pl.DataFrame(rows, schema=MARKS, orient="row")


def read_skill(path: Path, world: World | None = None) -> Skill:
    """Read and check a skill file for a world, our own by default.

    Raises:
        InputError: if the file cannot be read, or a field is missing, unknown or out of range.
    """
    world = world or load_world(RACING)
    skill = _located(path, read_toml(path, Skill, "skill"))
    places = _places(path, "scenario", skill.scenario, world)
    if skill.marks_scenario and _places(path, "marks_scenario", skill.marks_scenario, world) != places:
        raise InputError(
            f"{path}: field marks_scenario is {skill.marks_scenario!r}: expected one of {places} cars"
        )
    try:
        measured(skill.measure, world)
    except KeyError:
        known = ", ".join([*MEASURES, *(OWN + name for name in world.measures if name not in KNOWN)])
        raise InputError(f"{path}: field measure is {skill.measure!r}: expected one of {known}") from None
    if max(skill.slots) > places:
        raise InputError(f"{path}: field slots is {list(skill.slots)}: expected places from 1 to {places}")
    if places > 1 and not skill.opponents:
        raise InputError(f"{path}: field opponents is empty: expected someone for {places - 1} places")
    if places == 1 and (skill.opponents or skill.measure == "lead"):
        raise InputError(
            f"{path}: scenario {skill.scenario!r} has one car: expected no opponents and no lead"
        )
    for opponent in skill.opponents:
        is_frozen = skill.passed is not None
        if world.baseline == DRIVER and not is_frozen and opponent.partition(":")[0] != DRIVER:
            raise InputError(
                f"{path}: field opponents names {opponent!r}: expected built-in drivers as driver:pace=0.95"
            )
    return skill


def _located(path: Path, skill: Skill) -> Skill:
    """A skill whose scenario and opponents are found beside its file, if they are there."""

    def found(name: str) -> str:
        beside = path.parent / name
        return str(beside) if Path(name).suffix and beside.is_file() else name

    return skill.model_copy(
        update={"scenario": found(skill.scenario), "opponents": tuple(map(found, skill.opponents))}
    )


def _places(path: Path, field: str, scenario: str, world: World) -> int:
    """Sides of the scenario that a field of a skill file names."""
    try:
        return len(world.setup(scenario).sides)
    except InputError as error:
        raise InputError(f"{path}: field {field}: {error}") from None


def load_skills(names: Sequence[str], world: World | None = None) -> list[Skill]:
    """Skill tests by their shipped names or by the paths of `.toml` files; for a world, our own by default.

    Raises:
        InputError: if there is no such test, a file is wrong, or two tests have one name.
    """
    skills: dict[str, Skill] = {}
    for name in names:
        path = find_data(name, "skill", SKILLS_FOLDER)
        skill = read_skill(path, world)
        if skill.name in skills:
            raise InputError(f"{path}: field name is {skill.name!r}: expected one that no other test has")
        skills[skill.name] = skill
    return list(skills.values())


def standing_tests(world: World) -> list[Skill]:
    """Tests by score, in which a world's entrants are tested where nobody has written others.

    One for each scenario, and for each of its sides if they have roles: their scores may lie far apart.
    """
    tests = []
    for scenario in world.scenarios:
        setup = world.setup(scenario)
        slots = tuple(range(1, len(setup.sides) + 1))
        parts = {scenario: slots}
        if setup.roles:
            roles = [" and ".join(dict.fromkeys(setup.roles[seat] for seat in side)) for side in setup.sides]
            parts = {f"{scenario} as {role}": () for role in roles}
            for slot, role in zip(slots, roles, strict=True):
                parts[f"{scenario} as {role}"] += (slot,)
        tests += [
            Skill(
                name=name,
                description=f"the score in {name}",
                scenario=scenario,
                slots=played,
                opponents=(world.baseline,) if len(slots) > 1 else (),
                runs=-(-RUNS // len(played)) * len(played),  # equally often on each side
                measure="score",
                scoring=Gains(reference_gain=1.0, limit_gain=20.0, exponent=1.0, in_deviations=True),
            )
            for name, played in parts.items()
        ]
    return tests
