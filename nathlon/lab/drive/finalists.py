"""Opponents when none is named: the finalists of a run, or those that come with nathlon."""

from __future__ import annotations

from pathlib import Path

from nathlon.arena.store import Store
from nathlon.lab.drive.choice import DriveOpponent
from nathlon.policies import bundled
from nathlon.sim.errors import InputError
from nathlon.sim.names import as_named


def champions() -> list[DriveOpponent]:
    """The best bundled checkpoint of each circuit."""
    return [DriveOpponent.of(str(path)) for path in bundled.champions()]


def bundled_opponents() -> list[DriveOpponent]:
    """The champions, and the generalist, which drives all other circuits too."""
    return [*champions(), DriveOpponent.of(str(bundled.generalist()))]


def finalists(run: Path) -> list[DriveOpponent]:
    """Those that the last run in a folder has ranked, the best first.

    Raises:
        InputError: if there is no run that has ranked anybody, or a file is no longer there.
    """
    with Store.open(run / "store.sqlite") as store:
        for record in reversed(store.runs()):
            ranked = store.table(record.name, "ranking").sort("rank")["entrant"].to_list()
            known = {row["entrant"]: row for row in store.table(record.name, "entrants").to_dicts()}
            if ranked:
                rows = [known[entrant] for entrant in ranked]
                return DriveOpponent.all({as_named(row["source"]): row["name"] for row in rows})
    raise InputError(f"{run}: holds no run that has ranked anybody, expected the folder of a finished run")
