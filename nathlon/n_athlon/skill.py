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

from nathlon.arena.results import POLICY_FAULTS, VOID_ENDINGS
from nathlon.n_athlon.battery import MARKS
from nathlon.n_athlon.measures import MEASURES, Measure
from nathlon.n_athlon.scoring import BASE_POINTS, Kind, Scoring
from nathlon.policies.sources import DRIVER
from nathlon.sim.data_file import Name, Section, find_data, read_toml
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario

SKILLS_FOLDER = Path(__file__).parent.parent / "data" / "skills"

Runs = list[tuple[int, float | None]]
"""Index and mark of each run; None where it set no mark."""


class Gains(Section):
    """What is worth how much, seen from the built-in driver's 500 points.

    Gains are shares of its median mark where that is a time or a way, and in the measure's unit otherwise.

    Attributes:
        reference_gain: by which a mark worth 1,000 points is better than one worth 500.
        limit_gain: no mark counts for more than this: what lies beyond owes more to the opponents' accidents
            than to skill, and must not outweigh the other runs.
        exponent: how progressive the points are.
    """

    reference_gain: Annotated[float, Field(ge=1e-6, le=1e6)]
    limit_gain: Annotated[float, Field(ge=1e-6, le=1e6)]
    exponent: Annotated[float, Field(ge=0.01, le=100)]

    @model_validator(mode="after")
    def _in_order(self) -> Gains:
        if self.limit_gain < self.reference_gain:
            raise ValueError("limit_gain must not be less than reference_gain")
        return self


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
        opponents: built-in drivers that start from the other places, in turn.
        runs: how often, each with a seed of its own.
        measure: name of a measure, one of `nathlon.n_athlon.measures.MEASURES`.
        marks_scenario: what the built-in driver drives to set the marks, if not the scenario itself.
        contact_penalty: worsens the mark, in its unit, for each contact that the stewards lay to the entrant.
        scoring: what the marks are worth.
    """

    name: Name
    description: str
    scenario: str
    slots: Annotated[tuple[Annotated[int, Field(ge=1)], ...], Field(min_length=1)]
    opponents: tuple[str, ...] = ()
    runs: Annotated[int, Field(ge=1, le=1000)] = 8
    measure: str
    marks_scenario: str | None = None
    contact_penalty: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    scoring: Gains

    @model_validator(mode="after")
    def _known(self) -> Skill:
        if self.measure not in MEASURES:
            raise ValueError(f"measure is {self.measure!r}: expected one of {', '.join(MEASURES)}")
        for opponent in self.opponents:
            if opponent.partition(":")[0] != DRIVER:
                raise ValueError(
                    f"opponents names {opponent!r}: expected built-in drivers as driver:pace=0.95"
                )
        return self

    @property
    def how(self) -> Measure:
        """The measure itself."""
        return MEASURES[self.measure]

    @property
    def scenarios(self) -> tuple[str, str]:
        """What an entrant drives, and what the built-in driver drives to set the marks."""
        return self.scenario, self.marks_scenario or self.scenario

    def slot(self, run: int) -> int:
        """The entrant's starting place in a run."""
        return self.slots[run % len(self.slots)]

    def runs_of(self, results: pl.DataFrame) -> Runs:
        """The marks of an entrant's runs, from the RESULTS of its match; void races are left out."""
        runs: Runs = []
        for (race,), cars in results.sort("race", "car").group_by("race", maintain_order=True):
            rows = list(cars.iter_rows(named=True))
            if any(row["ending"] in VOID_ENDINGS for row in rows):
                continue
            run = int(str(race))
            own = next(row for row in rows if row["slot"] == self.slot(run))
            others = [row for row in rows if row is not own]
            mark = None if own["ending"] in POLICY_FAULTS else self.how.mark(own, others)
            if mark is not None:
                worse = self.contact_penalty * own["contacts_at_fault"]
                mark += worse if self.how.kind == "time" else -worse
            runs.append((run, mark))
        return runs

    def marks(self, driver: Runs) -> Marks | None:
        """The marks with which the driver's runs average 500 points; None where too many of them fail.

        The points of its median mark would not do: where some runs end in an accident, most are better
        than their mean.
        """
        marks = np.array([np.nan if mark is None else mark for _, mark in driver])
        valid = marks[np.isfinite(marks)]
        if not len(valid):
            return None
        middle = float(np.median(valid))
        scale = abs(middle) if self.how.relative else 1.0

        def about(base: float) -> Marks:
            return Marks.about(base, self.how.kind, self.scoring, scale)

        def surplus(base: float) -> float:
            return float(about(base).points(marks).mean()) - BASE_POINTS

        # At one end every mark set is worth nothing, at the other as much as any can be.
        reach = abs(about(middle).scoring.threshold - about(middle).limit)
        ends = (float(valid.min()) - reach, float(valid.max()) + reach)
        if max(surplus(end) for end in ends) < 0:
            return None
        return about(float(brentq(surplus, *ends)))

    def table(self, entrant: str, runs: Runs, marks: Marks) -> pl.DataFrame:
        """MARKS of an entrant's runs."""
        rows = [
            (
                entrant,
                self.name,
                run,
                mark,
                self.how.unit,
                float(marks.points(np.nan if mark is None else mark)),
            )
            for run, mark in runs
        ]
        return pl.DataFrame(rows, schema=MARKS, orient="row")


def read_skill(path: Path) -> Skill:
    """Read and check a skill file.

    Raises:
        InputError: if the file cannot be read, or a field is missing, unknown or out of range.
    """
    skill = read_toml(path, Skill, "skill")
    cars = _cars(path, "scenario", skill.scenario)
    if skill.marks_scenario and _cars(path, "marks_scenario", skill.marks_scenario) != cars:
        raise InputError(
            f"{path}: field marks_scenario is {skill.marks_scenario!r}: expected one of {cars} cars"
        )
    if max(skill.slots) > cars:
        raise InputError(f"{path}: field slots is {list(skill.slots)}: expected places from 1 to {cars}")
    if cars > 1 and not skill.opponents:
        raise InputError(f"{path}: field opponents is empty: expected someone for {cars - 1} places")
    if cars == 1 and (skill.opponents or skill.measure == "lead"):
        raise InputError(
            f"{path}: scenario {skill.scenario!r} has one car: expected no opponents and no lead"
        )
    return skill


def _cars(path: Path, field: str, scenario: str) -> int:
    """Cars in the scenario that a field of a skill file names."""
    try:
        return load_scenario(scenario).cars
    except InputError as error:
        raise InputError(f"{path}: field {field}: {error}") from None


def load_skills(names: Sequence[str]) -> list[Skill]:
    """Skill tests by their shipped names or by the paths of `.toml` files.

    Raises:
        InputError: if there is no such test, a file is wrong, or two tests have one name.
    """
    skills: dict[str, Skill] = {}
    for name in names:
        path = find_data(name, "skill", SKILLS_FOLDER)
        skill = read_skill(path)
        if skill.name in skills:
            raise InputError(f"{path}: field name is {skill.name!r}: expected one that no other test has")
        skills[skill.name] = skill
    return list(skills.values())
