"""`nathlon committee` and its commands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer

from nathlon.commands.groups import NAMES, CommandGroup
from nathlon.commands.options import AsJson, StoreName
from nathlon.results.ranks import written_rank
from nathlon.results.words import STAGES, figure, percent
from nathlon.sim.errors import InputError
from nathlon.terminal import new_table, print_json, print_table, say

if TYPE_CHECKING:
    from rich.table import Table

    from nathlon.selection.committee.decision import CommitteeDecision
    from nathlon.selection.committee.event_log import EventLog

SHORTEST_ID = 6
MEASURED_IN = {"shortlist": STAGES["battery"], "selection": STAGES["tournament"]}
"""The stage that the figures come from by which a question is answered."""
READING = (
    "Rank: a range where no order is proven. For: ballots that approve. "
    "Favour: share of the comparisons with others that it wins."
)

committee = CommandGroup("Ask the committee, vote and decide.")

Question = Annotated[
    Literal["shortlist", "selection"] | None,
    typer.Option(help="Decision; not needed where only one is open."),
]
Member = Annotated[str, typer.Option(help="Your name, as in the configuration.")]
Reason = Annotated[str, typer.Option(help="Reason, in a sentence.")]


class RunPlace(NamedTuple):
    """Where the committee's record is: the store, and the name of the run, or the last one."""

    store: str
    run: str | None


@committee.callback()
def place(
    context: typer.Context,
    store: StoreName,
    run: Annotated[str | None, typer.Option(help="Name of the run; the last by default.")] = None,
) -> None:
    """Ask the committee, vote and decide."""
    context.obj = RunPlace(store, run)


@committee.command()
def show(context: typer.Context, as_json: AsJson = False) -> None:
    """Show what is asked, the evidence, what has been said, and what follows."""
    from nathlon.selection.committee.decision import describe

    with _event_log(context.obj) as event_log:
        decisions = event_log.decisions().values()
    if as_json:
        print_json([describe(decision).model_dump(mode="json") for decision in decisions])
        return
    if not decisions:
        say("The committee has not been asked anything.")
    for decision in decisions:
        _print(decision)


@committee.command()
def vote(
    context: typer.Context,
    member: Member,
    reason: Reason,
    approve: Annotated[
        str | None,
        typer.Option(
            metavar=NAMES, help="Names of those that are fit, separated by commas; those ranked by default."
        ),
    ] = None,
    rank: Annotated[
        str, typer.Option(metavar=NAMES, help="Names, best first, separated by commas; need not be all.")
    ] = "",
    question: Question = None,
    as_json: AsJson = False,
) -> None:
    """Cast a ballot; it replaces what you said before."""
    from nathlon.selection import committee
    from nathlon.selection.committee.ballots import Ballot

    with _event_log(context.obj) as event_log:
        decision = _pick(event_log, question, closed=False)
        ranked = _entrants(decision, rank)
        approved = ranked if approve is None else _entrants(decision, approve)
        committee.vote(event_log, decision, member, Ballot(approved, ranked), reason)
        _report(event_log, decision, as_json)


@committee.command()
def compare(
    context: typer.Context,
    member: Member,
    better: Annotated[str, typer.Option(help="Name of the one that you prefer.")],
    worse: Annotated[str, typer.Option(help="Name of the other.")],
    reason: Reason,
    question: Question = None,
    as_json: AsJson = False,
) -> None:
    """Say which of two you prefer."""
    from nathlon.selection import committee

    with _event_log(context.obj) as event_log:
        decision = _pick(event_log, question, closed=False)
        first, second = (_entrant(decision.opened.candidates, name) for name in (better, worse))
        committee.compare(event_log, decision, member, first, second, reason)
        _report(event_log, decision, as_json)


@committee.command()
def decide(
    context: typer.Context, member: Member, question: Question = None, as_json: AsJson = False
) -> None:
    """Close a decision by what has been said."""
    from nathlon.selection import committee

    with _event_log(context.obj) as event_log:
        decision = committee.close(event_log, _pick(event_log, question, closed=False), member)
        _report(event_log, decision, as_json)


@committee.command()
def reopen(
    context: typer.Context,
    member: Member,
    reason: Reason,
    question: Question = None,
    as_json: AsJson = False,
) -> None:
    """Put a closed decision again; what was said still counts."""
    from nathlon.selection import committee

    with _event_log(context.obj) as event_log:
        decision = _pick(event_log, question, closed=True)
        committee.reopen(event_log, decision, member, reason)
        _report(event_log, decision, as_json)


@committee.command()
def log(context: typer.Context, as_json: AsJson = False) -> None:
    """List all that has ever been said, in order."""
    from nathlon.selection.committee.sentences import names_in, sentence

    with _event_log(context.obj) as event_log:
        entries = event_log.entries()
    if as_json:
        print_json([entry.describe() for entry in entries])
        return
    names = names_in(entries)
    for entry in entries:
        say(f"{entry.id:>5} {entry.at[:19]} {entry.event.decision}: {sentence(entry, names)}")


@contextmanager
def _event_log(place: RunPlace) -> Iterator[EventLog]:
    from nathlon.arena.store import Store
    from nathlon.selection.committee.event_log import EventLog

    with Store.open(place.store) as store:
        runs = [record.name for record in store.runs()]
        if not runs:
            raise InputError(f"{store.name}: holds no run, expected one that the committee can judge")
        if place.run is not None and place.run not in runs:
            raise InputError(f"{store.name}: no run {place.run!r}, the last is {runs[-1]!r}")
        yield EventLog(store, place.run or runs[-1])


def _pick(event_log: EventLog, question: Question, closed: bool) -> CommitteeDecision:
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


def _entrants(decision: CommitteeDecision, names: str) -> tuple[str, ...]:
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


def _report(event_log: EventLog, decision: CommitteeDecision, as_json: bool) -> None:
    """Print the decision as it stands now."""
    from nathlon.selection.committee.decision import describe

    now = event_log.decisions()[decision.opened.question]
    if as_json:
        print_json(describe(now).model_dump(mode="json"))
    else:
        _print(now)


def _print(decision: CommitteeDecision) -> None:
    from nathlon.selection.committee.sentences import sentence

    wanted = decision.opened.seats
    state = "closed" if decision.result else "open"
    if decision.result is None and decision.waits_for:
        state += f", waits for {decision.waits_for} more"
    say(f"{decision.name}: {wanted} wanted, {state}")
    print_table(_standings(decision))
    source = MEASURED_IN[decision.opened.question]
    chosen = "chosen" if decision.result else "would be chosen as it stands"
    say(f"  * {chosen}: first of those that are fit; ties go to higher favour, then to more points.")
    say(f"  Figures are of the {source}. {READING}")
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
        meaning = "1: all order alike; -1: two order the other way round"
        say(f"  Agreement of the members: {result.agreement:.2f} ({meaning})")


def _standings(decision: CommitteeDecision) -> Table:
    """Evidence and standing of every candidate, from first to last."""
    from rich.text import Text

    result = decision.result or decision.tally()
    shown = {row["entrant"]: row for row in decision.opened.evidence.rows}
    conduct = ("Contacts\nper km", "At fault\nper km", "Off\ncourse", "Faults")
    heads = ("Points", "Rank", *conduct, "For", "Favour")
    table = new_table(None, ("", "Entrant", *heads), ("", "Entrant"), lean=True)
    for column in table.columns:
        column.header = Text(str(column.header))  # keeps its line ends, which texts from elsewhere must not
    for standing in result.standings:
        row = shown[standing.entrant]
        table.add_row(
            "*" if standing.chosen else "",
            row["name"],
            figure(row["points"], row["low"], row["high"], ".4g"),
            written_rank(row["rank"], row.get("worst_rank")),
            figure(row["contacts_per_km"]),
            figure(row["at_fault_per_km"]),
            percent(row["off_course_share"], 1),
            str(row["faults"]),
            f"{standing.approved_by}/{result.ballots}",
            percent(standing.favour),
        )
    return table
