"""`nathlon watch`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nathlon.commands.nightly import facts, hold_night, say_outcome, tell_night
from nathlon.commands.options import AsJson, ConfigFile, Workers
from nathlon.commands.selection import stoppable
from nathlon.sim.errors import InputError
from nathlon.terminal import print_json, warn

if TYPE_CHECKING:
    from nathlon.selection.nightly.night import Night


def watch(
    config: ConfigFile = Path("nathlon.toml"),
    workers: Workers = None,
    most: Annotated[int, typer.Option(min=1, max=10_000, help="Checkpoints that are judged together.")] = 8,
    every: Annotated[
        float, typer.Option(min=1, max=86_400, help="Seconds between two looks while nothing is new.")
    ] = 30.0,
    wait: Annotated[
        float | None, typer.Option(min=0, help="Seconds without news after which it ends; never by default.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Judge checkpoints as they come: a small night whenever something is new, the most promising first.

    Newest first, of training runs whose checkpoints have done well; runs that nobody has judged are looked at
    early. Ctrl-C ends it; the same command goes on.
    """
    from nathlon.selection.config import read_config
    from nathlon.selection.nightly.night import told

    settings = read_config(config)
    nights: list[dict[str, Any]] = []
    try:
        with stoppable("The same command goes on."):
            for night in _held(lambda: hold_night(settings, workers, as_json, most), every, wait):
                done = tell_night(night, settings, as_json)
                if as_json:
                    nights.append(facts(done, settings))
                else:
                    say_outcome(done)
                    sys.stdout.flush()
                told(settings, done.night)
    except BaseException:
        if nights:
            print_json({"nights": nights})
        raise
    if as_json:
        print_json({"nights": nights})


def _held(hold: Callable[[], Night], every: float, wait: float | None) -> Iterator[Night]:
    """The nights of which there is something to tell.

    Args:
        hold: holds one, or finds nothing new.
        every: seconds between two looks while nothing is new.
        wait: seconds without news after which there are no more; None for ever.

    Raises:
        InputError: if the first look fails, or the last.
    """
    news, said, looked = time.monotonic(), "", False
    while True:
        trouble: InputError | None = None
        try:
            night = hold()
        except InputError as error:
            # A disk or an address that was there may be away for a while.
            if not looked:
                raise
            trouble, reason = error, f"{error}."
        else:
            looked, reason = True, night.reason
            if night.counts:
                yield night
                news, said = time.monotonic(), ""
                continue
        if wait is not None and time.monotonic() - news >= wait:
            if trouble is not None:
                raise trouble
            return
        if said != reason:
            said = reason
            warn(f"{said} Looking again every {every:g} s.")
        time.sleep(every if wait is None else min(every, wait))
