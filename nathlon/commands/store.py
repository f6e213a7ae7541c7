"""`nathlon store`: look after stores."""

from __future__ import annotations

from typing import Annotated

import typer

from nathlon.commands.options import AsJson, StoreName
from nathlon.commands.selection import stoppable
from nathlon.terminal import tell


def copy_store(
    store: StoreName,
    target: Annotated[str, typer.Argument(help="Where to: a new file, or the URL of an empty database.")],
    as_json: AsJson = False,
) -> None:
    """Copy matches, runs and the log of a store into a new one: from a file into a database, or back."""
    from nathlon.arena.store import Store
    from nathlon.progress import progress_bars

    with (
        stoppable("The same command goes on."),
        Store.open(store) as source,
        Store(target) as copy,
        progress_bars(not as_json) as bars,
    ):
        task = bars.add_task("copy", total=None, note="matches")
        count = source.copy_to(copy, lambda done, total: bars.update(task, completed=done, total=total))
        told = {"store": copy.name, "matches": count, "runs": len(copy.runs())}
    tell(told, as_json)
