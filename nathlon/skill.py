"""Skill tests: data files that name a scenario, its opponents, a measure and its scoring."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import polars as pl
from pydantic import Field, model_validator

from nathlon.battery import MEASURES
from nathlon.scoring import Scoring
from sim.data_file import Section, read_toml
from sim.errors import InputError
from sim.scenario import load_scenario

SKILLS_FOLDER = Path(__file__).parent / "data" / "skills"
UNIT = "s"


class Marks(Section):
    """The marks that give 500 (`base`, the built-in driver's) and 1,000 points.

    No mark counts for more than `limit`: what lies beyond owes more to the opponents' accidents than
    to skill, and must not outweigh the other runs.
    """

    base: float
    reference: float
    exponent: Annotated[float, Field(gt=0)]
    limit: float


class Skill(Section):
    """One test of the battery.

    Attributes:
        scenario: what is driven.
        slots: starting places of the entrant, in turn from run to run.
        opponents: who starts from the other places, in turn.
        runs: how often, each with a seed of its own.
        measure: `time` to the finish, or `lead` over the best opponent there; both in seconds.
        contact_penalty_s: worsens the measure for each contact made while behind and faster.
        scoring: marks of the points.
    """

    name: str
    scenario: str
    slots: Annotated[tuple[int, ...], Field(min_length=1)]
    opponents: tuple[str, ...]
    runs: Annotated[int, Field(ge=1)]
    measure: Literal["time", "lead"]
    contact_penalty_s: Annotated[float, Field(ge=0)]
    scoring: Marks

    @model_validator(mode="after")
    def _better(self) -> Skill:
        sign = -1.0 if self.measure == "time" else 1.0
        if not sign * self.scoring.base < sign * self.scoring.reference <= sign * self.scoring.limit:
            raise ValueError("scoring.base, reference and limit must be each better than the last")
        return self

    def points(self) -> Scoring:
        """The scoring through the marks."""
        marks = self.scoring
        kind: Literal["time", "distance"] = "time" if self.measure == "time" else "distance"
        return Scoring.through(kind, marks.base, marks.reference, marks.exponent)


def read_skill(path: Path) -> Skill:
    """Read and check a skill file.

    Raises:
        InputError: if the file cannot be read, or a field is missing, unknown or out of range.
    """
    skill = read_toml(path, Skill, "skill")
    cars = load_scenario(skill.scenario).cars
    if not all(1 <= slot <= cars for slot in skill.slots):
        raise InputError(f"{path}: field slots is {skill.slots}: expected places from 1 to {cars}")
    if cars > 1 and not skill.opponents:
        raise InputError(f"{path}: field opponents is empty: expected someone for {cars - 1} places")
    return skill


def shipped_skills() -> list[Skill]:
    """The battery that comes with nathlon."""
    return [read_skill(path) for path in sorted(SKILLS_FOLDER.glob("*.toml"))]


def measure_runs(skill: Skill, entrant: str, results: pl.DataFrame) -> pl.DataFrame:
    """Marks and points (MEASURES) of an entrant's runs, from the RESULTS of its match."""
    rows: list[dict[str, Any]] = []
    scoring = skill.points()
    for (run,), race in results.sort("race", "car").group_by("race", maintain_order=True):
        own = race.filter(pl.col("entrant") == entrant).row(0, named=True)
        mark = own["race_time_s"]
        if mark is not None:
            penalty = skill.contact_penalty_s * own["contacts_faster_behind"]
            if skill.measure == "time":
                mark = max(mark + penalty, skill.scoring.limit)
            else:
                others = race.filter(pl.col("entrant") != entrant)
                lead = others["race_time_s"].fill_null(others["driven_s"]).min() - mark
                mark = min(lead - penalty, skill.scoring.limit)
        points = 0.0 if mark is None else float(scoring.points(mark))
        rows.append(
            {
                "entrant": entrant,
                "test": skill.name,
                "run": run,
                "measure": mark,
                "unit": UNIT,
                "points": points,
            }
        )
    return pl.DataFrame(rows, schema=MEASURES)
