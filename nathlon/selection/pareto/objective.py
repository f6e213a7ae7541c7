"""The objectives of the filter: what its races and time trials measure, and which way is better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Literal

import numpy as np
import polars as pl
from pydantic import ConfigDict, Field, model_validator

from nathlon.arena.match import TESTED
from nathlon.arena.results import OBJECTIVES, POLICY_FAULTS, VOID_ENDINGS
from nathlon.arena.rounding import levelled
from nathlon.arena.statistics import Floats, Sizes, group_sums
from nathlon.arena.tested import RACE as RACE_KEY
from nathlon.arena.tested import entrant_rows
from nathlon.arena.world import KNOWN, Measure
from nathlon.sim.data_file import Section

RACE: Final = "race"
TIME_TRIAL: Final = "time_trial"
"""Tests of the filter: names by which its matches are known."""


@dataclass(frozen=True)
class MeasuredRate:
    """What is measured: events for each unit of exposure, summed over runs.

    Attributes:
        unit: of the ratio.
        events: of a row of RESULTS; null where it gave no value.
        exposure: likewise, above 0 where it gave a value.
    """

    unit: str
    events: pl.Expr
    exposure: pl.Expr


def _mean(value: pl.Expr, unit: str) -> MeasuredRate:
    return MeasuredRate(unit, value, value.is_not_null())


def _share(column: str) -> MeasuredRate:
    return MeasuredRate("1", pl.col(column), pl.col("driven_s"))


def _per_km(column: str) -> MeasuredRate:
    return MeasuredRate("1/km", pl.col(column), pl.col("distance_m") / 1000)


_let_down = pl.col("ending").is_in(POLICY_FAULTS)

QUANTITIES: dict[str, MeasuredRate] = {
    "lap_s": _mean(pl.when(~_let_down).then("best_lap_s"), "s"),
    "race_time_s": _mean(pl.when(~_let_down).then("race_time_s"), "s"),
    "place": _mean(pl.col("place"), "place"),
    "points": _mean(pl.col("points"), "points"),
    "unfinished_share": _mean(pl.col("ending") != "finished", "1"),
    "off_course_share": _share("off_course_s"),
    "wall_share": _share("wall_s"),
    "contacts_per_km": _per_km("contacts"),
    "contacts_at_fault_per_km": _per_km("contacts_at_fault"),
    "penalties_per_km": _per_km("penalties"),
}
"""All that can be an objective: means over runs of the best lap, the time to the finish, the place, the
points and whether the finish was missed; shares of the time driven; counts a kilometre driven."""


OWN = "own."
"""Before the name of a measure that a world declares itself."""


def quantity(measure: str) -> MeasuredRate:
    """What a measure stands for: one of `QUANTITIES`, or the mean of a world's measure over runs.

    Raises:
        KeyError: if there is none of this name.
    """
    if measure in QUANTITIES:
        return QUANTITIES[measure]
    if measure.startswith(OWN):
        value = pl.col("measures").str.json_path_match(f"$.{measure.removeprefix(OWN)}").cast(pl.Float64)
        return _mean(pl.when(~_let_down).then(value), "1")
    return _mean(pl.when(~_let_down).then(pl.col(measure).cast(pl.Float64)), KNOWN[measure].unit)


class Objective(Section):
    """One objective.

    Attributes:
        name: unique among the objectives.
        measure: one of `QUANTITIES` or of `nathlon.arena.world.KNOWN`, or `own.NAME` of a world.
        source: whether it is measured in the race or in the time trial; `from` in files.
        goal: whether less or more is better.
    """

    model_config = ConfigDict(populate_by_name=True)

    name: Annotated[str, Field(min_length=1)]
    measure: str
    source: Annotated[Literal["race", "time_trial"], Field(alias="from")]
    goal: Literal["min", "max"] = "min"

    @model_validator(mode="after")
    def _measurable(self) -> Objective:
        if self.measure not in {*QUANTITIES, *KNOWN} and not self.measure.startswith(OWN):
            raise ValueError(f"measure is {self.measure!r}: expected one of {', '.join(QUANTITIES)}")
        return self


LAP = Objective(name="lap_s", measure="lap_s", source="time_trial")
OFF_COURSE = Objective(name="off_course_share", measure="off_course_share", source="race")
CONTACTS = Objective(name="contacts_per_km", measure="contacts_per_km", source="race")


@dataclass(frozen=True)
class Measured:
    """An objective of some entrants, as costs: in its unit, and less is always better.

    Attributes:
        entrants: (E,) ids, ordered; those for whom at least one run gave a value.
        cost: (E,) over all runs.
        runs: (rows,) cost of each run, those of an entrant together.
        sizes: (E,) runs of each entrant.
    """

    entrants: list[str]
    cost: Floats
    runs: Floats
    sizes: Sizes

    def of(self, entrants: Sequence[str]) -> Measured:
        """Only some of the entrants."""
        kept = np.isin(self.entrants, entrants)
        return Measured(
            [entrant for entrant, stays in zip(self.entrants, kept, strict=True) if stays],
            self.cost[kept],
            self.runs[np.repeat(kept, self.sizes)],
            self.sizes[kept],
        )


def own_runs(results: pl.DataFrame) -> pl.DataFrame:
    """The rows of RESULTS of those under test, one a race, without void races; in a fixed order."""
    void = pl.col("ending").is_in(VOID_ENDINGS).any().over(RACE_KEY)
    return entrant_rows(results.filter(~void)).sort("entrant", "test", "seed", *RACE_KEY)


def measure(runs: pl.DataFrame, objective: Objective) -> Measured:
    """An objective of the entrants of some `own_runs`.

    A run that gave no value (no lap, no way driven) counts as the worst one of the field.
    """
    measured = quantity(objective.measure)
    rows = runs.filter(pl.col("test") == objective.source).select(
        "entrant",
        events=measured.events.cast(pl.Float64),
        exposure=measured.exposure.cast(pl.Float64),
    )
    gave = pl.col("events").is_not_null() & (pl.col("exposure") > 0)
    rows = rows.with_columns(gave=gave).filter(pl.col("gave").any().over("entrant"))
    sign = -1.0 if objective.goal == "max" else 1.0
    given = rows["gave"].to_numpy()
    events, exposure = (rows[name].fill_null(0.0).to_numpy() for name in ("events", "exposure"))
    costs = sign * np.divide(events, exposure, out=np.zeros(len(given)), where=given)
    costs[~given] = costs[given].max(initial=-np.inf)
    costs = levelled(costs)
    exposure = np.where(given, exposure, 1.0)
    names = rows["entrant"].rle()
    sizes = names.struct.field("len").cast(pl.Int64).to_numpy()
    if not len(sizes):
        return Measured([], np.zeros(0), costs, sizes)
    cost = levelled(group_sums(costs * exposure, sizes) / group_sums(exposure, sizes))
    return Measured(names.struct.field("value").to_list(), cost, costs, sizes)


def objectives_table(
    results: pl.DataFrame, objectives: Sequence[Objective], own: Mapping[str, Measure] = {}
) -> pl.DataFrame:
    """OBJECTIVES of all entrants under test in some RESULTS, ordered by entrant, then as configured.

    Args:
        results: of the filter.
        objectives: what is measured.
        own: measures that the world declares, for their units.
    """
    tables = []
    entrants = under_test(results)
    runs = own_runs(results)
    for position, objective in enumerate(objectives):
        measured = measure(runs, objective)
        values = value_column(measured, objective, "value").with_columns(runs=measured.sizes)
        tables.append(
            entrants.join(values, on="entrant", how="left", maintain_order="left").with_columns(
                pl.col("runs").fill_null(0),
                objective=pl.lit(objective.name),
                source=pl.lit(objective.source),
                unit=pl.lit(_unit(objective.measure, own)),
                goal=pl.lit(objective.goal),
                position=position,
            )
        )
    return pl.concat(tables).sort("entrant", "position").select(OBJECTIVES.names()).cast(OBJECTIVES)


def _unit(measure: str, own: Mapping[str, Measure]) -> str:
    if measure.startswith(OWN):
        return own[measure.removeprefix(OWN)].unit
    return quantity(measure).unit


def under_test(results: pl.DataFrame) -> pl.DataFrame:
    """The entrants under test, ordered; one column."""
    return results.filter(pl.col("team") == TESTED).select(pl.col("entrant").unique().sort())


def value_column(measured: Measured, objective: Objective, name: str) -> pl.DataFrame:
    """Entrants and the objective's values in its unit, under a name."""
    sign = -1.0 if objective.goal == "max" else 1.0
    return pl.DataFrame(
        {"entrant": measured.entrants, name: sign * measured.cost},
        schema={"entrant": pl.String, name: pl.Float64},
    )
