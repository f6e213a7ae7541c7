"""What the commands of `nathlon committee` do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import nathlon.selection.committee as committee
from nathlon.arena.store import Store
from nathlon.commands.place import Place
from nathlon.results.ranks import written_rank
from nathlon.selection.committee.ballots import Ballot
from nathlon.selection.committee.decision import Decision, describe
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.committee.rules import Question
from nathlon.selection.committee.sentences import names_in, sentence
from nathlon.sim.errors import InputError
from nathlon.terminal import new_table, print_json, print_table, say

if TYPE_CHECKING:
    from rich.table import Table

SHORTEST_ID = 6


def show(place: Place, as_json: bool) -> None:
    """Print the last decision on each question."""
    with _event_log(place) as event_log:
        decisions = event_log.decisions().values()
    if as_json:
        print_json([describe(decision).model_dump(mode="json") for decision in decisions])
        return
    if not decisions:
        say("The committee has not been asked anything.")
    for decision in decisions:
        _print(decision)


def vote(
    place: Place,
    question: Question | None,
    member: str,
    approve: str | None,
    rank: str,
    reason: str,
    as_json: bool,
) -> None:
    """Cast a ballot; without `approve`, those that it ranks are approved."""
    with _event_log(place) as event_log:
        decision = _pick(event_log, question, closed=False)
        ranked = _entrants(decision, rank)
        approved = ranked if approve is None else _entrants(decision, approve)
        committee.vote(event_log, decision, member, Ballot(approved, ranked), reason)
        _report(event_log, decision, as_json)


def compare(
    place: Place, question: Question | None, member: str, better: str, worse: str, reason: str, as_json: bool
) -> None:
    """Note an answer to "A or B?"."""
    with _event_log(place) as event_log:
        decision = _pick(event_log, question, closed=False)
        first, second = (_entrant(decision.opened.candidates, name) for name in (better, worse))
        committee.compare(event_log, decision, member, first, second, reason)
        _report(event_log, decision, as_json)


def decide(place: Place, question: Question | None, member: str, as_json: bool) -> None:
    """Close a decision."""
    with _event_log(place) as event_log:
        decision = committee.close(event_log, _pick(event_log, question, closed=False), member)
        _report(event_log, decision, as_json)


def reopen(place: Place, question: Question | None, member: str, reason: str, as_json: bool) -> None:
    """Put a closed decision again."""
    with _event_log(place) as event_log:
        decision = _pick(event_log, question, closed=True)
        committee.reopen(event_log, decision, member, reason)
        _report(event_log, decision, as_json)


def log(place: Place, as_json: bool) -> None:
    """Print all entries."""
    with _event_log(place) as event_log:
        entries = event_log.entries()
    if as_json:
        print_json([entry.describe() for entry in entries])
        return
    names = names_in(entries)
    for entry in entries:
        say(f"{entry.id:>5} {entry.at[:19]} {entry.event.decision}: {sentence(entry, names)}")


@contextmanager
def _event_log(place: Place) -> Iterator[EventLog]:
    with Store.open(place.store) as store:
        runs = [record.name for record in store.runs()]
        if not runs:
            raise InputError(f"{store.name}: holds no run, expected one that the committee can judge")
        if place.run is not None and place.run not in runs:
            raise InputError(f"{store.name}: no run {place.run!r}, the last is {runs[-1]!r}")
        yield EventLog(store, place.run or runs[-1])


def _pick(event_log: EventLog, question: Question | None, closed: bool) -> Decision:
    """The decision on a question, or else the one that is open or closed, as wanted."""
    decisions = event_log.decisions()
    if question is not None:
        if question not in decisions:
            raise InputError(f"the committee has not been asked for the {question}")
        return decisions[question]
    found = [decision for decision in decisions.values() if (decision.result is not None) == closed]
    if len(found) > 1:
        raise InputError(
            f"--question is not given, expected one that is {'closed' if closed else 'open'}: "
            f"{' or '.join(one.opened.question for one in found)}"
        )
    if not found:
        raise InputError(
            f"no decision is {'closed' if closed else 'open'}; reopen one or run a selection first"
        )
    return found[0]


def _entrants(decision: Decision, names: str) -> tuple[str, ...]:
    """Ids of the candidates in a list with commas."""
    stripped = [name.strip() for name in names.split(",")]
    return tuple(_entrant(decision.opened.candidates, name) for name in stripped if name)


def _entrant(candidates: Mapping[str, str], name: str) -> str:
    """The id of the candidate that has this name, or an id that begins so."""
    found = [entrant for entrant, own in candidates.items() if name in (own, entrant)]
    if not found and len(name) >= SHORTEST_ID:
        found = [entrant for entrant in candidates if entrant.startswith(name)]
    if len(found) != 1:
        raise InputError(f"{name!r} is not a candidate, expected one of {', '.join(candidates.values())}")
    return found[0]


def _report(event_log: EventLog, decision: Decision, as_json: bool) -> None:
    """Print the decision as it stands now."""
    now = event_log.decisions()[decision.opened.question]
    if as_json:
        print_json(describe(now).model_dump(mode="json"))
    else:
        _print(now)


def _print(decision: Decision) -> None:
    wanted = decision.opened.seats
    state = "closed" if decision.result else "open"
    if decision.result is None and decision.waits_for:
        state += f", waits for {decision.waits_for} more"
    say(f"{decision.name}: {wanted} wanted, {state}")
    print_table(_standings(decision))
    names = decision.opened.candidates
    for said in decision.said.values():
        for entry in said:
            late = " (too late to count)" if entry in decision.late else ""
            # A ballot of test drives has a reason of many parts.
            first, *others = f"{sentence(entry, names)}{late}".split("; ")
            for start, part in [(entry.at[:19], first), *((" " * 19, other) for other in others)]:
                say(f"  {start}  {part}")
    result = decision.result or decision.tally()
    if result.agreement is not None:
        say(f"  Agreement of the members: {result.agreement:.2f} (1 is all alike, -1 contrary)")


def _standings(decision: Decision) -> Table:
    """Evidence and standing of every candidate, from first to last."""
    result = decision.result or decision.tally()
    shown = {row["entrant"]: row for row in decision.opened.evidence.rows}
    table = new_table(lean=True)
    table.add_column("")
    table.add_column("Entrant")
    for column in (
        "Points",
        "Rank",
        "Contacts a km",
        "At fault a km",
        "Off course",
        "Faults",
        "For",
        "Favour",
    ):
        table.add_column(column, justify="right")
    for standing in result.standings:
        row = shown[standing.entrant]
        table.add_row(
            "*" if standing.chosen else "",
            row["name"],
            _interval(row),
            written_rank(row["rank"], row.get("worst_rank")),
            _figure(row["contacts_per_km"], ".2f"),
            _figure(row["at_fault_per_km"], ".2f"),
            _figure(row["off_course_share"], ".1%"),
            str(row["faults"]),
            f"{standing.approved_by}/{result.ballots}",
            f"{standing.favour:.2f}",
        )
    return table


def _interval(row: Mapping[str, Any]) -> str:
    points = _figure(row["points"], ".4g")
    if row["low"] is None or row["high"] is None:
        return points
    return f"{points} ({row['low']:.4g} to {row['high']:.4g})"


def _figure(value: float | None, form: str) -> str:
    return "–" if value is None else format(value, form)
