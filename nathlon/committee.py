"""The committee: what it is asked, what its members say, and what follows.

It decides twice in a run: who of the battery's field is shortlisted, and after the round robin who is
sent. All that is said is kept in an append-only log; the state of a question is a fold over it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import polars as pl

from arena.entrant import Entrant
from arena.store import Store
from nathlon.ballots import Ballot, Preferences, agreement, order, support
from nathlon.committee_events import (
    EVENT,
    Closed,
    Compared,
    Entry,
    Event,
    Opened,
    Reopened,
    Result,
    Standing,
    Voted,
)
from nathlon.committee_rules import SOURCES, CommitteeSettings, Question, gather
from sim.errors import InputError

LOG = "committee"
"""The kind of its entries in the store's log."""


@dataclass
class Decision:
    """A question and all that has been said about it.

    Attributes:
        said: what counts of each member: the last ballot and the comparisons after it.
        result: None while the question is open.
        reopened: whether it has been put again.
    """

    opened: Opened
    said: dict[str, list[Entry]] = field(default_factory=dict)
    result: Result | None = None
    reopened: bool = False

    @cached_property
    def name(self) -> str:
        """See `Opened.decision`."""
        return self.opened.decision

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
            case Compared(decision=self.name, member=member):
                self.said.setdefault(member, []).append(entry)
            case Closed(decision=self.name, result=result) if self.result is None:
                self.result = result
            case Reopened(decision=self.name) if self.result is not None:
                self.result, self.reopened = None, True

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
                case Compared(better=better, worse=worse):
                    first, second = candidates.index(better), candidates.index(worse)
                    stated[first, second], stated[second, first] = 1, -1
        return stated

    def tally(self) -> Result:
        """What would follow now.

        A candidate is fit if half of the ballots or more approve it. The fit ones are ordered by
        `nathlon.ballots.order`, and the first of them chosen; a seat for which none is left stays empty.
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


class Minutes:
    """The record of a run's committee; entries are added and never changed."""

    def __init__(self, store: Store, run: str) -> None:
        self._store, self._run = store, run

    def add(self, event: Event) -> None:
        """Add an entry, whoever else may be adding one."""
        self._store.append(LOG, event.model_dump(mode="json"), self._run)

    def entries(self) -> list[Entry]:
        """All entries in their order."""
        return [
            Entry(entry.id, entry.at, EVENT.validate_python(entry.entry))
            for entry in self._store.log(LOG, self._run)
        ]

    def decisions(self) -> dict[Question, Decision]:
        """The last decision on each question; one on other evidence takes the place of the one before."""
        return fold(self.entries())


def fold(entries: Iterable[Entry]) -> dict[Question, Decision]:
    """The last decision on each question, after all entries."""
    decisions: dict[Question, Decision] = {}
    for entry in entries:
        if isinstance(entry.event, Opened):
            current = decisions.get(entry.event.question)
            if current is None or current.opened != entry.event:
                decisions[entry.event.question] = Decision(entry.event)
        else:
            for decision in decisions.values():
                decision.apply(entry)
    return decisions


def shortlist(
    minutes: Minutes,
    entrants: Sequence[Entrant],
    tables: Mapping[str, pl.DataFrame],
    results: pl.DataFrame,
    settings: CommitteeSettings,
) -> Decision:
    """Ask who reaches the round robin.

    Args:
        minutes: the committee's record; a question that stands there already is not put again.
        entrants: the battery's field.
        tables: of the stages so far, `battery` among them.
        results: RESULTS of the battery.
        settings: the committee.

    Returns:
        the decision; its result is None as long as it waits for people.
    """
    return _ask("shortlist", settings.shortlist, minutes, entrants, tables, results, settings)


def choose(
    minutes: Minutes,
    entrants: Sequence[Entrant],
    tables: Mapping[str, pl.DataFrame],
    results: pl.DataFrame,
    settings: CommitteeSettings,
) -> Decision:
    """Ask who is sent; as `shortlist`, with the finalists, `ranking` and the RESULTS of the round robin."""
    return _ask("selection", 1, minutes, entrants, tables, results, settings)


def _ask(
    question: Question,
    seats: int,
    minutes: Minutes,
    entrants: Sequence[Entrant],
    tables: Mapping[str, pl.DataFrame],
    results: pl.DataFrame,
    settings: CommitteeSettings,
) -> Decision:
    evidence = gather(question, entrants, tables, results)
    opened = Opened(question=question, seats=seats, settings=settings, evidence=evidence)
    decision = minutes.decisions().get(question)
    if decision is None or decision.opened != opened:
        minutes.add(opened)
        decision = minutes.decisions()[question]
    for rule in settings.rule:
        if rule.by == SOURCES[question] and rule.member not in decision.said:
            ballot, reason = rule.vote(evidence)
            minutes.add(_voted(decision, rule.member, ballot, reason))
    decision = minutes.decisions()[question]
    # Whoever put the question again wants to be heard: it is for people to decide it.
    if decision.result is None and not decision.waits_for and not decision.reopened:
        return close(minutes, decision)
    return decision


def _voted(decision: Decision, member: str, ballot: Ballot, reason: str) -> Voted:
    return Voted(
        decision=decision.name,
        member=member,
        approve=ballot.approve,
        rank=ballot.rank,
        reason=reason,
        evidence=decision.opened.evidence.digest,
    )


def vote(minutes: Minutes, decision: Decision, member: str, ballot: Ballot, reason: str) -> None:
    """Cast a member's ballot.

    Args:
        minutes: the committee's record.
        decision: on what.
        member: one of the people on the committee.
        ballot: of entrant ids.
        reason: in the member's own words.

    Raises:
        InputError: if the decision is closed, the member unknown, the reason empty, or the ballot
            names somebody twice or ranks one that it does not approve before one that it does.
    """
    _check(decision, member, reason)
    for what, named in (("approve", ballot.approve), ("rank", ballot.rank)):
        if len(set(named)) < len(named):
            raise InputError(f"{what} names an entrant twice, expected each once")
    approval = [entrant in ballot.approve for entrant in ballot.rank]
    if approval != sorted(approval, reverse=True):
        names = decision.opened.candidates
        lower = ballot.rank[approval.index(False)]
        raise InputError(f"rank puts {names[lower]} before an approved entrant, but it is not approved")
    minutes.add(_voted(decision, member, ballot, reason))


def compare(minutes: Minutes, decision: Decision, member: str, better: str, worse: str, reason: str) -> None:
    """Note which of two entrants (ids) a member prefers.

    Raises:
        InputError: if the decision is closed, the member unknown, the reason empty, or both are the same.
    """
    _check(decision, member, reason)
    if better == worse:
        raise InputError(
            f"{decision.opened.candidates[better]} is compared with itself, expected two entrants"
        )
    minutes.add(
        Compared(
            decision=decision.name,
            member=member,
            better=better,
            worse=worse,
            reason=reason,
            evidence=decision.opened.evidence.digest,
        )
    )


def close(minutes: Minutes, decision: Decision) -> Decision:
    """Decide by what has been said.

    Raises:
        InputError: if it is decided already, or waits for people.
    """
    _check_open(decision)
    if decision.waits_for:
        raise InputError(
            f"{decision.name} waits for {decision.waits_for} more of its members, "
            f"expected {decision.opened.settings.quorum} to have voted"
        )
    minutes.add(Closed(decision=decision.name, result=decision.tally()))
    return minutes.decisions()[decision.opened.question]


def reopen(minutes: Minutes, decision: Decision, reason: str) -> None:
    """Put a decided question again.

    Raises:
        InputError: if it is still open, or the reason empty.
    """
    if decision.result is None:
        raise InputError(f"{decision.name} is open, expected a decision that is closed")
    _check_reason(reason)
    minutes.add(Reopened(decision=decision.name, reason=reason))


def _check(decision: Decision, member: str, reason: str) -> None:
    _check_open(decision)
    members = decision.opened.settings.members
    if member not in members:
        known = f"one of {', '.join(members)}" if members else "members in the configuration"
        raise InputError(f"{member!r} is not on the committee, expected {known}")
    _check_reason(reason)


def _check_open(decision: Decision) -> None:
    if decision.result is not None:
        raise InputError(f"{decision.name} is closed; reopen it first")


def _check_reason(reason: str) -> None:
    if not reason.strip():
        raise InputError("reason is empty, expected a sentence")


def describe(decision: Decision) -> dict[str, Any]:
    """A decision as plain JSON values; while it is open, the result is the one that would follow now."""
    names = decision.opened.candidates
    result = decision.result or decision.tally()
    evidence = decision.opened.evidence
    return {
        "decision": decision.name,
        "question": decision.opened.question,
        "seats": decision.opened.seats,
        "open": decision.result is None,
        "waits_for": decision.waits_for,
        "evidence": {"digest": evidence.digest, **evidence.model_dump(mode="json")},
        "said": [entry.describe() for said in decision.said.values() for entry in said],
        "late": [entry.id for entry in decision.late],
        "ballots": result.ballots,
        "agreement": result.agreement,
        "standings": [
            {"name": names[standing.entrant], **standing.model_dump()} for standing in result.standings
        ],
    }
