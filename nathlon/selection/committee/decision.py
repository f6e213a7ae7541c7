"""A decision of the committee: what is asked, what its members have said, and what follows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from nathlon.results.summary import CandidateStanding, Decided
from nathlon.selection.committee.ballots import Ballot, Preferences, agreement, order, support
from nathlon.selection.committee.events import (
    Closed,
    Comparison,
    Drove,
    Entry,
    Opened,
    Reopened,
    Result,
    Standing,
    Voted,
)


@dataclass
class CommitteeDecision:
    """A question and all that has been said about it.

    Attributes:
        said: what counts of each member: the last ballot and the comparisons after it.
        drives: test drives of its members, which count through their ballots alone.
        result: None while the question is open.
        reopened: whether it has been put again.
    """

    opened: Opened
    said: dict[str, list[Entry]] = field(default_factory=dict)
    drives: list[Entry] = field(default_factory=list)
    result: Result | None = None
    reopened: bool = False

    @cached_property
    def name(self) -> str:
        """See `Opened.decision`."""
        return self.opened.decision

    @property
    def chosen(self) -> tuple[str, ...]:
        """Ids of those that were chosen, none while the question is open."""
        return () if self.result is None else self.result.chosen

    @property
    def waits_for(self) -> int:
        """How many people of the quorum have not voted."""
        voted = sum(member in self.said for member in self.opened.settings.members)
        return max(0, self.opened.settings.quorum - voted)

    @property
    def late(self) -> list[Entry]:
        """What was said too late for the result."""
        if self.result is None:
            return []
        entries = [entry for said in self.said.values() for entry in said]
        return [entry for entry in entries if entry.id not in self.result.counted]

    def apply(self, entry: Entry) -> None:
        """Take in the next entry of the log; one about another decision changes nothing."""
        match entry.event:
            case Voted(decision=self.name, member=member):
                self.said[member] = [entry]
            case Comparison(decision=self.name, member=member):
                self.said.setdefault(member, []).append(entry)
            case Drove(decision=self.name):
                self.drives.append(entry)
            case Closed(decision=self.name, result=result) if self.result is None:
                self.result = result
            case Reopened(decision=self.name) if self.result is not None:
                self.result, self.reopened = None, True

    def drives_of(self, member: str) -> list[Drove]:
        """A member's test drives, in their order."""
        events = (entry.event for entry in self.drives)
        return [event for event in events if isinstance(event, Drove) and event.member == member]

    @property
    def told_drives(self) -> list[Entry]:
        """Test drives that may be shown: none of a member who still drives blind."""
        ballots = self.ballots()
        return [
            entry
            for entry in self.drives
            if self.result is not None or (isinstance(entry.event, Drove) and entry.event.member in ballots)
        ]

    def ballots(self) -> dict[str, Voted]:
        """The ballots that count, by member."""
        first = {member: said[0].event for member, said in self.said.items()}
        return {member: event for member, event in first.items() if isinstance(event, Voted)}

    def preferences(self) -> dict[str, Preferences]:
        """What each member who said anything prefers, over the candidates in their order."""
        return {member: self._preferences(said) for member, said in self.said.items()}

    def _preferences(self, said: Iterable[Entry]) -> Preferences:
        candidates = list(self.opened.candidates)
        stated = np.zeros((len(candidates), len(candidates)), np.int8)
        for entry in said:
            match entry.event:
                case Voted(approve=approve, rank=rank):
                    stated = Ballot(approve, rank).preferences(candidates)
                case Comparison(better=better, worse=worse):
                    first, second = candidates.index(better), candidates.index(worse)
                    stated[first, second], stated[second, first] = 1, -1
        return stated

    def tally(self) -> Result:
        """What would follow now.

        A candidate is fit if half of the ballots or more approve it. The fit ones are ordered by
        `nathlon.selection.committee.ballots.order`, and the first of them chosen; a seat for which none is
        left stays empty.
        """
        ballots = self.ballots().values()
        candidates = list(self.opened.candidates)
        preferences = list(self.preferences().values())
        places, favour = order(support(preferences, len(candidates)))
        approved_by = {c: sum(c in ballot.approve for ballot in ballots) for c in candidates}
        fit = {c: 2 * approved_by[c] >= len(ballots) for c in candidates}
        ordered = sorted(places, key=lambda index: not fit[candidates[index]])
        standings = [
            Standing(
                entrant=candidates[index],
                approved_by=approved_by[candidates[index]],
                fit=fit[candidates[index]],
                favour=float(favour[index]),
                chosen=fit[candidates[index]] and place < self.opened.seats,
            )
            for place, index in enumerate(ordered)
        ]
        return Result(
            standings=tuple(standings),
            ballots=len(ballots),
            agreement=agreement(preferences),
            counted=tuple(sorted(entry.id for said in self.said.values() for entry in said)),
        )


def describe(decision: CommitteeDecision) -> Decided:
    """A decision as the summary says it; while it is open, the result is the one that would follow now."""
    names = decision.opened.candidates
    result = decision.result or decision.tally()
    evidence = decision.opened.evidence
    return Decided(
        decision=decision.name,
        question=decision.opened.question,
        seats=decision.opened.seats,
        open=decision.result is None,
        waits_for=decision.waits_for,
        evidence={"digest": evidence.digest, **evidence.model_dump(mode="json")},
        said=tuple(entry.describe() for said in decision.said.values() for entry in said),
        drives=tuple(entry.describe() for entry in decision.told_drives),
        late=tuple(entry.id for entry in decision.late),
        ballots=result.ballots,
        agreement=result.agreement,
        standings=tuple(
            CandidateStanding(name=names[standing.entrant], **standing.model_dump())
            for standing in result.standings
        ),
    )
