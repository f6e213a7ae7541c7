"""Who sits on the committee, what it is shown, and how its automatic members vote."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import polars as pl
from pydantic import AfterValidator, Field, model_validator

from nathlon.arena.entrant import Entrant
from nathlon.arena.results import POLICY_FAULTS, VOID_ENDINGS
from nathlon.results.words import AUTOMATIC, SHARE, measure_called
from nathlon.selection.bounds import MOST_SHORTLISTED
from nathlon.selection.committee.ballots import Ballot
from nathlon.sim.data_file import Name, Section
from nathlon.sim.validation import check_distinct

Question = Literal["shortlist", "selection"]
SOURCES: dict[Question, str] = {"shortlist": "battery", "selection": "ranking"}
"""The table whose points stand before the committee at each question."""
POINTS = {"battery": "points", "ranking": "points_per_race"}
CALLED = {"battery": "n-athlon points", "ranking": "points in the round robin"}
"""What people call those points."""

CONDUCT = pl.Schema(
    {
        "entrant": pl.String,
        "km": pl.Float64,  # driven, all its cars together
        "contacts_per_km": pl.Float64,  # a car; null where nothing was driven
        "at_fault_per_km": pl.Float64,
        "off_course_share": pl.Float64,  # of the time driven
        "faults": pl.Int64,  # car runs that ended by the policy's fault
    }
)


def _no_rule(name: str) -> str:
    if name.startswith(AUTOMATIC):
        raise ValueError(f"expected a name that does not begin with {AUTOMATIC!r}")
    return name


Member = Annotated[Name, AfterValidator(_no_rule)]
NotNegative = Annotated[float, Field(ge=0)]


class Gates(Section):
    """What an automatic member tolerates, each at most; None is any. The fields are those of CONDUCT."""

    contacts_per_km: NotNegative | None = None
    at_fault_per_km: NotNegative | None = None
    off_course_share: Annotated[float, Field(ge=0, le=1)] | None = None
    faults: Annotated[int, Field(ge=0)] | None = 0


class Rule(Section):
    """An automatic member: approves who passes its gates, and ranks them by their points.

    Attributes:
        by: the table with the points, and so the question that it answers: `battery` the shortlist,
            `ranking` the selection.
    """

    name: Member
    by: Literal["battery", "ranking"]
    gates: Gates = Gates()

    @property
    def member(self) -> str:
        """The name under which it votes."""
        return AUTOMATIC + self.name

    def vote(self, evidence: CommitteeEvidence) -> tuple[Ballot, str]:
        """Its ballot and its reason."""
        failures = {row["entrant"]: self._failures(row) for row in evidence.rows}
        fit = tuple(entrant for entrant, failed in failures.items() if not failed)
        reason = f"{len(fit)} of {len(failures)} pass the gates, in order of {CALLED[self.by]}"
        left_out = [
            f"{row['name']} ({', '.join(failures[row['entrant']])})"
            for row in evidence.rows
            if failures[row["entrant"]]
        ]
        if left_out:
            reason += f"; left out: {'; '.join(left_out)}"
        return Ballot(fit, fit), reason

    def _failures(self, row: Mapping[str, Any]) -> list[str]:
        failures = ["barred from the ranking"] if row["barred"] else []
        for field, most in self.gates.model_dump(exclude_none=True).items():
            if row[field] is None or row[field] > most:
                own, limit = (_number(value, field) for value in (row[field], most))
                failures.append(f"{measure_called(field)}: {own}, at most {limit}")
        return failures


class CommitteeSettings(Section):
    """The committee.

    Attributes:
        members: people who may vote.
        rule: automatic members, which always vote.
        shortlist: how many reach the round robin at most.
        quorum: people who must have voted before a question is decided; with 0 it is decided at once.
    """

    members: tuple[Member, ...] = ()
    rule: tuple[Rule, ...] = (Rule(name="battery", by="battery"), Rule(name="ranking", by="ranking"))
    shortlist: Annotated[int, Field(ge=1, le=MOST_SHORTLISTED)] = 6
    quorum: Annotated[int, Field(ge=0)] = 0

    def seats(self, question: Question) -> int:
        """How many are wanted, at most."""
        return self.shortlist if question == "shortlist" else 1

    @model_validator(mode="after")
    def _complete(self) -> CommitteeSettings:
        check_distinct(members=self.members, rule=[rule.name for rule in self.rule])
        if self.quorum > len(self.members):
            raise ValueError(f"quorum is {self.quorum}, expected at most the {len(self.members)} members")
        for by in SOURCES.values():
            if not self.quorum and not any(rule.by == by for rule in self.rule):
                raise ValueError(f"expected a rule by {by!r}, or a quorum of members")
        return self


class CommitteeEvidence(Section):
    """What the members are shown.

    Attributes:
        rows: of each candidate its `entrant`, `name`, `points` with `low` and `high` ends, `rank` and
            `worst_rank`, whether it is `barred` from the ranking, and its CONDUCT; those with most points
            first.
        tables: SHA-256 of the report's tables that lie behind, by name.
    """

    rows: tuple[dict[str, Any], ...]
    tables: dict[str, str]

    @property
    def digest(self) -> str:
        """SHA-256 of it all."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()


def gather(
    question: Question,
    entrants: Sequence[Entrant],
    tables: Mapping[str, pl.DataFrame],
    results: pl.DataFrame,
) -> CommitteeEvidence:
    """What there is to know about the candidates of a question.

    Args:
        question: what is asked.
        entrants: the candidates.
        tables: of the stages so far, by their names in `nathlon.arena.results.TABLES`.
        results: RESULTS of the races that the candidates are judged by.
    """
    source = SOURCES[question]
    names = pl.DataFrame(
        {"entrant": [entrant.id for entrant in entrants], "name": [entrant.name for entrant in entrants]},
        schema={"entrant": pl.String, "name": pl.String},
    )
    scores = tables[source].select(
        "entrant",
        pl.col(POINTS[source]).alias("points"),
        pl.col("points_low").alias("low"),
        pl.col("points_high").alias("high"),
        "rank",
        "worst_rank",
        pl.col("barred") if source == "ranking" else pl.lit(False).alias("barred"),
    )
    rows = (
        names.join(scores, on="entrant", how="left", maintain_order="left")
        .join(conduct(results), on="entrant", how="left", maintain_order="left")
        .with_columns(
            pl.col("faults").fill_null(0),
            pl.col("barred").fill_null(False),
            pl.col(pl.Float64).fill_nan(None),
        )
        .sort("points", descending=True, nulls_last=True, maintain_order=True)
    )
    digests = {name: _digest(table) for name, table in sorted(tables.items())}
    return CommitteeEvidence(rows=tuple(rows.to_dicts()), tables=digests)


def conduct(results: pl.DataFrame) -> pl.DataFrame:
    """How everybody behaved in some races (RESULTS), as CONDUCT by entrant; void races do not count."""
    void = pl.col("ending").is_in(VOID_ENDINGS).any().over("match", "race")
    km = pl.col("distance_m").clip(lower_bound=0.0).sum() / 1000.0
    driven = pl.col("driven_s").sum()
    return (
        results.filter(~void)
        .group_by("entrant")
        .agg(
            km=km,
            contacts_per_km=pl.when(km > 0).then(pl.col("contacts").sum() / km),
            at_fault_per_km=pl.when(km > 0).then(pl.col("contacts_at_fault").sum() / km),
            off_course_share=pl.when(driven > 0).then(pl.col("off_course_s").sum() / driven),
            faults=pl.col("ending").is_in(POLICY_FAULTS).sum(),
        )
        .sort("entrant")
        .cast(CONDUCT)
        # The order of sums must not make it other evidence.
        .with_columns(pl.col(pl.Float64).round(9))
    )


def _digest(table: pl.DataFrame) -> str:
    return hashlib.sha256(table.write_csv().encode()).hexdigest()


def _number(value: float | None, field: str) -> str:
    if value is None:
        return "unknown"
    return f"{100 * value:.3g} %" if field.endswith(SHARE) else f"{value:.3g}"
