"""What can happen before the committee: the entries of its log."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal

from pydantic import Field, TypeAdapter

from nathlon.selection.committee.rules import CommitteeEvidence, CommitteeSettings, Question
from nathlon.sim.data_file import Section

THE_RUN: Final = "the run"
"""Author of what a run enters by itself."""


class Opened(Section):
    """A question is put.

    Attributes:
        member: whoever puts it.
        seats: how many are wanted at most.
        settings: who may answer.
        evidence: on which; its rows are the candidates.
    """

    event: Literal["opened"] = "opened"
    member: Literal["the run"] = THE_RUN
    question: Question
    seats: int
    settings: CommitteeSettings
    evidence: CommitteeEvidence

    @property
    def decision(self) -> str:
        """Name of the decision, the same for the same question on the same evidence."""
        asked = self.model_dump_json(exclude={"member"})
        return f"{self.question}-{hashlib.sha256(asked.encode()).hexdigest()[:12]}"

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


class Comparison(Section):
    """An answer to "A or B?"; of those two it replaces what the member's ballot says."""

    event: Literal["compared"] = "compared"
    decision: str
    member: str
    better: str
    worse: str
    reason: str
    evidence: str


Score = Annotated[int, Field(ge=1, le=5)]
"""An answer of a questionnaire: 1 is not at all, 5 is very much."""


class Scores(Section):
    """What a driver says of a candidate after a race against it.

    Attributes:
        again: would the driver race it again?
        fair: was it fair in contact?
        room: did it leave room?
        beatable: was it beatable?
    """

    again: Score
    fair: Score
    room: Score
    beatable: Score


class Answers(Scores):
    """Scores of a candidate, with the letter under which it raced."""

    entrant: str
    letter: str


class EventMoment(Section):
    """A moment that the driver marked.

    Attributes:
        time_s: since the start.
        lap_m: where the driver's car was, along the lap.
        nearest: the entrant nearest to it, and how far its car was; None where nobody drove.
    """

    time_s: float
    lap_m: float
    nearest: str | None
    apart_m: float | None


class Drove(Section):
    """A member has raced candidates that stood under letters; it counts only through the ballot that follows.

    Attributes:
        answers: about those that the member met in the race.
        better: the one that the member prefers; None where there was nothing to tell.
        text: in the member's own words; may be empty.
        recording: of the race, a path from the run's folder.
    """

    event: Literal["drove"] = "drove"
    decision: str
    member: str
    answers: tuple[Answers, ...]
    better: str | None
    text: str
    recording: str
    moments: tuple[EventMoment, ...]


class Standing(Section):
    """How a candidate stands.

    Attributes:
        approved_by: how many ballots approve.
        fit: approved by half of the ballots or more.
        favour: see `nathlon.selection.committee.ballots.favour`.
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
        agreement: of the members, see `nathlon.selection.committee.ballots.agreement`.
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
    """The question is decided.

    Attributes:
        member: whoever decided; `THE_RUN` where all had voted, None in older logs.
    """

    event: Literal["closed"] = "closed"
    decision: str
    member: str | None = None
    result: Result


class Reopened(Section):
    """The question is put again; what was said still counts.

    Attributes:
        member: whoever put it; None in older logs.
    """

    event: Literal["reopened"] = "reopened"
    decision: str
    member: str | None = None
    reason: str


Event = Annotated[Opened | Voted | Comparison | Drove | Closed | Reopened, Field(discriminator="event")]
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
