"""What the page of a member may ask for."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from nathlon.selection.committee.rules import Question

LONGEST_REASON = 2000
"""Letters."""

Reason = Annotated[str, Field(max_length=LONGEST_REASON)]


class _Wish(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Look(_Wish):
    """To be shown a run, and told of what changes in it; the last one without a name."""

    type: Literal["look"]
    run: str | None = None


class Steer(_Wish):
    """To have the work on the store go on so; see `nathlon.arena.control.Control`.

    What is not said stays as it is: somebody else may have changed it since the page was shown.
    """

    type: Literal["steer"]
    paused: bool = False
    first: str | None = None

    @property
    def changed(self) -> dict[str, Any]:
        """What is said, by name."""
        return self.model_dump(include=self.model_fields_set - {"type"})


class _About(_Wish):
    """What is said of a decision.

    Attributes:
        question: that was asked.
        decision: name of what the page has shown; another one may have taken its place.
    """

    question: Question
    decision: str


class Vote(_About):
    """A ballot, of entrant ids."""

    type: Literal["vote"]
    approve: tuple[str, ...]
    rank: tuple[str, ...]
    reason: Reason


class Compare(_About):
    """An answer to "A or B?", of entrant ids."""

    type: Literal["compare"]
    better: str
    worse: str
    reason: Reason


class Decide(_About):
    """To close the decision."""

    type: Literal["decide"]


class Reopen(_About):
    """To put the question again."""

    type: Literal["reopen"]
    reason: Reason


Said = Vote | Compare | Decide | Reopen
Wish = Annotated[Look | Steer | Said, Field(discriminator="type")]
WISH: TypeAdapter[Look | Steer | Said] = TypeAdapter(Wish)
"""Reads one from the page's message."""
