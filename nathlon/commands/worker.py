"""`nathlon worker`: race what waits in a store."""

from __future__ import annotations

from typing import Annotated

import typer

from nathlon.commands.options import AsJson, StoreName, Workers
from nathlon.commands.selection import at_work
from nathlon.terminal import tell


def worker(
    store: StoreName,
    workers: Workers = None,
    wait: Annotated[float, typer.Option(min=0, help="Seconds to wait for matches before it ends.")] = 60.0,
    world: Annotated[
        list[str] | None,
        typer.Option("--world", help="Another simulator that may be loaded; named as for evaluate."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Race the matches that wait in a store, on any machine that reaches it, until there are none.

    Selections put them there: nathlon nightly and nathlon evaluate --store. It may join late, and be stopped.
    """
    with at_work("Its matches are free for others."):
        from nathlon.api.worker import work

        shift = work(store, workers=workers, worlds=world or (), wait_s=wait, progress=not as_json)
    tell({"matches": shift.matches, "refused": shift.refused}, as_json)
