"""`nathlon watch`."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from nathlon.commands.nightly import facts, hold_night, say_outcome, tell_night
from nathlon.commands.options import AsJson, ConfigFile, Workers
from nathlon.commands.selection import stoppable
from nathlon.sim.errors import InputError
from nathlon.terminal import print_json, warn


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
    news, quiet, looked = time.monotonic(), "", False
    trouble: InputError | None = None
    try:
        with stoppable("The same command goes on."):
            while True:
                try:
                    night = hold_night(settings, workers, as_json, most)
                except InputError as error:
                    # A disk or an address that was there may be away for a while.
                    if not looked:
                        raise
                    trouble, reason = error, f"{error}."
                else:
                    looked, trouble, reason = True, None, night.reason
                    if night.counts:
                        done = tell_night(night, settings, as_json)
                        if as_json:
                            nights.append(facts(done, settings))
                        else:
                            say_outcome(done)
                            sys.stdout.flush()
                        told(settings, done.night)
                        news, quiet = time.monotonic(), ""
                        continue
                if wait is not None and time.monotonic() - news >= wait:
                    break
                if quiet != reason:
                    quiet = reason
                    warn(f"{quiet} Looking again every {every:g} s.")
                time.sleep(every if wait is None else min(every, wait))
        if trouble is not None:
            raise trouble
    except BaseException:
        if as_json and nights:
            print_json({"nights": nights})
        raise
    if as_json:
        print_json({"nights": nights})
