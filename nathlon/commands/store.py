"""`nathlon store`: look after stores."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from nathlon.commands.options import AsJson, StoreName
from nathlon.commands.selection import stoppable
from nathlon.terminal import tell

LEAST_DAYS = 1 / 24
"""An hour: in that time at most, matches follow their files into the queue."""


def copy_store(
    store: StoreName,
    target: Annotated[str, typer.Argument(help="Target: a new file, or the URL of an empty database.")],
    as_json: AsJson = False,
) -> None:
    """Copy matches, runs and the log of a store into a new one: from a file into a database, or back."""
    from nathlon.arena.store import Store
    from nathlon.terminal.progress import stage_progress

    with (
        stoppable("The same command goes on."),
        Store.open(store) as source,
        Store(target) as copy,
        stage_progress(not as_json, ("copy",)) as on_match,
    ):
        count = source.copy_to(copy, partial(on_match, "copy"))
        told = {"store": copy.name, "matches": count, "runs": len(copy.runs())}
    tell(told, as_json)


def clean_store(
    store: StoreName,
    days: Annotated[
        float,
        typer.Option(min=LEAST_DAYS, max=36_500, help="Keep what was stored or used within this many days."),
    ] = 7.0,
    as_json: AsJson = False,
) -> None:
    """Remove checkpoints that were sent to workers and that no waiting match needs; results stay."""
    from nathlon.arena.store import Store

    with Store.open(store) as opened:
        removed, size = opened.remove_files(days * 86_400)
        told = {"store": opened.name, "removed": removed, "bytes": size}
    tell(told, as_json)
