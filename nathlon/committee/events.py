"""What can happen before the committee: the entries of its log."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter

from nathlon.committee.rules import CommitteeSettings, Evidence, Question
from nathlon.sim.data_file import Section


class Opened(Section):
    """A question is put.

    Attributes:
        seats: how many are wanted at most.
        settings: who may answer.
        evidence: on which; its rows are the candidates.
    """

    event: Literal["opened"] = "opened"
    question: Question
    seats: int
    settings: CommitteeSettings
    evidence: Evidence

    @property
    def decision(self) -> str:
        """Name of the decision, the same for the same question on the same evidence."""
        return f"{self.question}-{hashlib.sha256(self.model_dump_json().encode()).hexdigest()[:12]}"

    @property
    def candidates(self) -> dict[str, str]:
        """Names by entrant ids."""
        return {row["entrant"]: row["name"] for row in self.evidence.rows}


class Voted(Section):
    """A ballot; it replaces all that its member said before.

    Attributes:
        evidence: digest of what the member was shown.
    """

    event: Literal["voted"] = "voted"
    decision: str
    member: str
    approve: tuple[str, ...]
    rank: tuple[str, ...]
    reason: str
    evidence: str


class Compared(Section):
    """An answer to "A or B?"; of those two it replaces what the member's ballot says."""

    event: Literal["compared"] = "compared"
    decision: str
    member: str
    better: str
    worse: str
    reason: str
    evidence: str


class Standing(Section):
    """How a candidate stands.

    Attributes:
        approved_by: how many ballots approve.
        fit: approved by half of the ballots or more.
        favour: see `nathlon.committee.ballots.favour`.
        chosen: fit, and among the first as many as there are seats.
    """

    entrant: str
    approved_by: int
    fit: bool
    favour: float
    chosen: bool


class Result(Section):
    """What follows from what the members said.

    Attributes:
        standings: those that are fit before the others, each from first to last.
        ballots: cast.
        agreement: of the members, see `nathlon.committee.ballots.agreement`.
        counted: log entries that it rests on.
    """

    standings: tuple[Standing, ...]
    ballots: int
    agreement: float | None
    counted: tuple[int, ...]

    @property
    def chosen(self) -> tuple[str, ...]:
        """Entrant ids, the first first."""
        return tuple(standing.entrant for standing in self.standings if standing.chosen)


class Closed(Section):
    """The question is decided."""

    event: Literal["closed"] = "closed"
    decision: str
    result: Result


class Reopened(Section):
    """The question is put again; what was said still counts."""

    event: Literal["reopened"] = "reopened"
    decision: str
    reason: str


Event = Annotated[Opened | Voted | Compared | Closed | Reopened, Field(discriminator="event")]
EVENT: TypeAdapter[Event] = TypeAdapter(Event)
"""Reads one from the plain values of a log entry."""


@dataclass(frozen=True)
class Entry:
    """An event in the log, with its number and the time at which it was added."""

    id: int
    at: str
    event: Event

    def describe(self) -> dict[str, Any]:
        """The entry as plain JSON values."""
        return {"id": self.id, "at": self.at, **self.event.model_dump(mode="json")}
