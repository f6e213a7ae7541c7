"""From the recording of a race back to the match that it was part of."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl

from nathlon.arena.entrance import enter_all
from nathlon.arena.match import Match
from nathlon.arena.pool import Pool
from nathlon.arena.race_log import RaceLog
from nathlon.arena.single_race import single_race
from nathlon.arena.store import Store
from nathlon.selection.incident.drivers import sources_of
from nathlon.selection.publish.recordings import stored_match
from nathlon.sim.errors import InputError


class Rebuilt(NamedTuple):
    """A match, and its entrants' names as recordings show them."""

    match: Match
    names: tuple[str, ...]


def rebuild(
    pool: Pool, log: RaceLog, recording: Path, store: Path | str | None, named: Mapping[str, str]
) -> Rebuilt:
    """The match of a recorded race: the one that a store holds, or a single race of those it names.

    Args:
        pool: opens the policies of a single race.
        log: the race.
        recording: its file, for errors.
        store: where the match may be; None where there is none.
        named: sources of policies by their names in the recording, for a single race.

    Raises:
        InputError: if a policy is not known or cannot be loaded, or the simulator, its data or a policy are
            others than those that drove.
    """
    if store is not None:
        with Store.open(store) as opened:
            if opened.has(log.match):
                entrants = pl.concat([opened.table(run.name, "entrants") for run in opened.runs()]).unique(
                    "entrant", keep="last", maintain_order=True
                )
                match = stored_match(opened, log.match, entrants)
                names = dict(entrants.select("entrant", "name").iter_rows())
                return Rebuilt(match, tuple(names.get(entrant, entrant) for entrant in match.entrants))
    return _single(pool, log, recording, store, named)


def _single(
    pool: Pool, log: RaceLog, recording: Path, store: Path | str | None, named: Mapping[str, str]
) -> Rebuilt:
    """A race that `nathlon race --record` has left: its entrants fill the grid in turn."""
    sources = sources_of(log, store, named, "--entrant")
    first = {name: sources[car] for car, name in reversed(list(enumerate(log.names)))}
    entered = enter_all(pool, [first[name] for name in dict.fromkeys(log.names)], log.circuit, log.car)
    match = single_race(entered, log.scenario, log.seed)
    if match.key != log.match:
        raise InputError(
            f"{recording}: cannot be raced again: the simulator, its data or a policy have changed since, "
            "or it is one of many races of a match; expected --store with its match, and all as it was"
        )
    return Rebuilt(match, tuple(entrant.name for entrant in entered))


def same_race(one: RaceLog, other: RaceLog) -> bool:
    """Whether two logs hold the same samples, to the bit."""
    return np.array_equal(one.time_s, other.time_s) and all(
        np.array_equal(one.samples[name], other.samples[name]) for name in one.samples.dtype.names or ()
    )
