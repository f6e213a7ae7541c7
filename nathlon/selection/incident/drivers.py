"""Who drove in a recorded race: the sources of its policies."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from nathlon.arena.race_log import RaceLog, start_number
from nathlon.arena.store import Store
from nathlon.policies.sources import DRIVER, PLUGIN
from nathlon.sim.errors import InputError
from nathlon.sim.names import as_named


def sources_of(
    log: RaceLog, store: Path | str | None, named: Mapping[str, str], option: str = "--policy"
) -> dict[int, str]:
    """Sources of the policies of a race by car.

    Args:
        log: the race.
        store: that holds its run; None where there is none.
        named: sources by the names of the policies, which come first.
        option: of the command by which these are given, for errors.

    Raises:
        InputError: if that of a car is not known.
    """
    known = dict(named)
    if store is not None:
        known = _entered(store) | known
    found: dict[int, str] = {}
    for car, name in enumerate(log.names):
        if name in known:
            found[car] = known[name]
        elif name.partition(":")[0] in (DRIVER, PLUGIN):
            found[car] = name
        else:
            raise InputError(
                f"car {start_number(car)} is {name!r}: expected {option} {name}=FILE, or --store with its run"
            )
    return found


def _entered(store: Path | str) -> dict[str, str]:
    """Sources of all that entered runs of a store, by name; the latest run counts."""
    with Store.open(store) as opened:
        return {
            name: as_named(source)
            for record in opened.runs()
            for name, source in opened.table(record.name, "entrants").select("name", "source").iter_rows()
        }
