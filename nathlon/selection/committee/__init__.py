"""The committee: how it is asked, how its members speak, and how it decides.

It decides twice in a run: who of the battery's field is shortlisted, and after the round robin who is
sent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import polars as pl

from nathlon.arena.entrant import Entrant
from nathlon.selection.committee.ballots import Ballot
from nathlon.selection.committee.decision import CommitteeDecision
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.committee.events import THE_RUN, Closed, Comparison, Opened, Reopened, Voted
from nathlon.selection.committee.rules import SOURCES, CommitteeSettings, Question, gather
from nathlon.sim.errors import InputError


def ask(
    event_log: EventLog,
    question: Question,
    entrants: Sequence[Entrant],
    tables: Mapping[str, pl.DataFrame],
    results: pl.DataFrame,
    settings: CommitteeSettings,
) -> CommitteeDecision:
    """Ask who reaches the round robin (`shortlist`), or who is sent (`selection`).

    A question that is in the log already, on the same evidence, is not put again.

    Args:
        event_log: of the run.
        question: what is asked.
        entrants: the candidates: the battery's field, or the finalists.
        tables: of the stages so far, with `battery` or `ranking`.
        results: RESULTS of the battery, or of the round robin.
        settings: the committee.

    Returns:
        the decision; its result is None as long as it waits for people.
    """
    evidence = gather(question, entrants, tables, results)
    opened = Opened(question=question, seats=settings.seats(question), settings=settings, evidence=evidence)
    decision = event_log.decisions().get(question)
    if decision is None or decision.opened != opened:
        event_log.add(opened)
        decision = event_log.decisions()[question]
    for rule in settings.rule:
        if rule.by == SOURCES[question] and rule.member not in decision.said:
            ballot, reason = rule.vote(evidence)
            event_log.add(_voted(decision, rule.member, ballot, reason))
    decision = event_log.decisions()[question]
    # Whoever put the question again wants to be heard: it is for people to decide it.
    if decision.result is None and not decision.waits_for and not decision.reopened:
        return _close(event_log, decision, THE_RUN)
    return decision


def _voted(decision: CommitteeDecision, member: str, ballot: Ballot, reason: str) -> Voted:
    return Voted(
        decision=decision.name,
        member=member,
        approve=ballot.approve,
        rank=ballot.rank,
        reason=reason,
        evidence=decision.opened.evidence.digest,
    )


def vote(event_log: EventLog, decision: CommitteeDecision, member: str, ballot: Ballot, reason: str) -> None:
    """Cast a member's ballot.

    Args:
        event_log: the committee's record.
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
    event_log.add(_voted(decision, member, ballot, reason))


def compare(
    event_log: EventLog, decision: CommitteeDecision, member: str, better: str, worse: str, reason: str
) -> None:
    """Note which of two entrants (ids) a member prefers.

    Raises:
        InputError: if the decision is closed, the member unknown, the reason empty, or both are the same.
    """
    _check(decision, member, reason)
    if better == worse:
        raise InputError(
            f"{decision.opened.candidates[better]} is compared with itself, expected two entrants"
        )
    event_log.add(
        Comparison(
            decision=decision.name,
            member=member,
            better=better,
            worse=worse,
            reason=reason,
            evidence=decision.opened.evidence.digest,
        )
    )


def close(event_log: EventLog, decision: CommitteeDecision, member: str) -> CommitteeDecision:
    """Decide by what has been said, as one of the people on the committee.

    Raises:
        InputError: if it is decided already, the member unknown, or it waits for people.
    """
    check_may_vote(decision, member)
    if decision.waits_for:
        raise InputError(
            f"{decision.name} waits for {decision.waits_for} more of its members, "
            f"expected {decision.opened.settings.quorum} to have voted"
        )
    return _close(event_log, decision, member)


def _close(event_log: EventLog, decision: CommitteeDecision, author: str) -> CommitteeDecision:
    event_log.add(Closed(decision=decision.name, member=author, result=decision.tally()))
    return event_log.decisions()[decision.opened.question]


def reopen(event_log: EventLog, decision: CommitteeDecision, member: str, reason: str) -> None:
    """Put a decided question again, as one of the people on the committee.

    Raises:
        InputError: if it is still open, the member unknown, or the reason empty.
    """
    if decision.result is None:
        raise InputError(f"{decision.name} is open, expected a decision that is closed")
    _check_member(decision, member)
    _check_reason(reason)
    event_log.add(Reopened(decision=decision.name, member=member, reason=reason))


def _check(decision: CommitteeDecision, member: str, reason: str) -> None:
    check_may_vote(decision, member)
    _check_reason(reason)


def check_may_vote(decision: CommitteeDecision, member: str) -> None:
    """Raise InputError if the decision is closed, or the member unknown."""
    _check_open(decision)
    _check_member(decision, member)


def _check_member(decision: CommitteeDecision, member: str) -> None:
    members = decision.opened.settings.members
    if member not in members:
        known = f"one of {', '.join(members)}" if members else "members in the configuration"
        raise InputError(f"{member!r} is not on the committee, expected {known}")


def _check_open(decision: CommitteeDecision) -> None:
    if decision.result is not None:
        raise InputError(f"{decision.name} is closed; reopen it first")


def _check_reason(reason: str) -> None:
    if not reason.strip():
        raise InputError("reason is empty, expected a sentence")
    if not reason.isprintable():
        raise InputError("reason holds characters that cannot be printed, expected a sentence on one line")
