"""`nathlon committee` and its commands, as the command line offers them."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from nathlon.commands.groups import NAMES, Group
from nathlon.commands.options import StoreName
from nathlon.commands.place import Place

committee = Group("Ask the committee, vote and decide.")

Question = Annotated[
    Literal["shortlist", "selection"] | None,
    typer.Option(help="Decision; not needed where only one is open."),
]
Member = Annotated[str, typer.Option(help="Your name, as in the configuration.")]
Reason = Annotated[str, typer.Option(help="Reason, in a sentence.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


@committee.callback()
def place(
    context: typer.Context,
    store: StoreName,
    run: Annotated[str | None, typer.Option(help="Name of the run; the last by default.")] = None,
) -> None:
    """Ask the committee, vote and decide."""
    context.obj = Place(store, run)


@committee.command()
def show(context: typer.Context, as_json: AsJson = False) -> None:
    """Show what is asked, the evidence, what has been said, and what follows."""
    from nathlon.commands.committee import show as run

    run(context.obj, as_json)


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
    from nathlon.commands.committee import vote as run

    run(context.obj, question, member, approve, rank, reason, as_json)


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
    from nathlon.commands.committee import compare as run

    run(context.obj, question, member, better, worse, reason, as_json)


@committee.command()
def decide(
    context: typer.Context, member: Member, question: Question = None, as_json: AsJson = False
) -> None:
    """Close a decision by what has been said."""
    from nathlon.commands.committee import decide as run

    run(context.obj, question, member, as_json)


@committee.command()
def reopen(
    context: typer.Context,
    member: Member,
    reason: Reason,
    question: Question = None,
    as_json: AsJson = False,
) -> None:
    """Put a closed decision again; what was said still counts."""
    from nathlon.commands.committee import reopen as run

    run(context.obj, question, member, reason, as_json)


@committee.command()
def log(context: typer.Context, as_json: AsJson = False) -> None:
    """List all that has ever been said, in order."""
    from nathlon.commands.committee import log as run

    run(context.obj, as_json)
