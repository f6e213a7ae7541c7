"""Races run again from the store, recorded and made to be looked at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from arena.match import Match
from arena.pool import match_policies
from arena.race_log import RaceLog
from arena.recorder import record_races
from arena.recording import write_recording
from arena.store import Store
from nathlon.decider import notable_races
from nathlon.output import OutputFolder
from reports.player import write_player
from reports.replay import write_replay
from sim.errors import InputError


def record_replays(
    store: Store, results: pl.DataFrame, tables: Mapping[str, pl.DataFrame], output: OutputFolder
) -> dict[str, Any]:
    """Run the notable races of a tournament again, and say where their files are from the report's folder.

    Every race leaves a recording (.mcap) and a page that plays it (.html); the deciding one, as `final`, also
    a Rerun replay (.rrd), which `nathlon replay` makes of any other.

    Returns:
        `replays`, each with `match`, `race`, `why`, `recording`, `player` and `replay` (paths or None), and
        `missing`: why it could not be run again, or None; and `recording` and `replay` of the deciding race.
    """
    replays = [
        {**race._asdict(), "recording": None, "player": None, "replay": None, "missing": None}
        for race in notable_races(results, tables["ranking"])
    ]
    for key in dict.fromkeys(replay["match"] for replay in replays):
        wanted = [replay for replay in replays if replay["match"] == key]
        try:
            match = _match(store, key, tables["entrants"])
            logs = _record(match, [replay["race"] for replay in wanted], tables["entrants"])
        except InputError as error:
            # The program or a checkpoint is another one by now; the report needs neither.
            for replay in wanted:
                replay["missing"] = str(error)
            continue
        for replay, log in zip(wanted, logs, strict=True):
            replay |= _files(log, output, final=replay is replays[0])
    first = replays[0] if replays else {"recording": None, "replay": None}
    return {"replays": replays, "recording": first["recording"], "replay": first["replay"]}


def _files(log: RaceLog, output: OutputFolder, final: bool) -> dict[str, str]:
    """Write what a race leaves, and say where."""
    name = "final" if final else f"{log.match[:10]}-{log.race}"
    recording, player = output.races / f"{name}.mcap", output.replays / f"{name}.html"
    write_recording(recording, log)
    write_player(log, player)
    written = {"recording": f"../races/{recording.name}", "player": f"../replays/{player.name}"}
    if final:
        replay = output.replays / f"{name}.rrd"
        write_replay(log, replay)
        written["replay"] = f"../replays/{replay.name}"
    return written


def record_stored_race(store: Store, address: str, folder: Path) -> Path:
    """Run a stored race once more and record it as `folder`/MATCH-RACE.mcap.

    Args:
        store: that holds its match.
        address: as KEY:RACE, or KEY where the match has one race; the first digits of the key are enough
            where no other begins with them.
        folder: made if it is missing.

    Raises:
        InputError: if there is no such race, its policies cannot be loaded, or the simulator has changed.
    """
    prefix, _, number = address.partition(":")
    key = _find(store, prefix)
    entrants = pl.concat([store.table(run.name, "entrants") for run in store.runs()]).unique(
        "entrant", keep="last", maintain_order=True
    )
    match = _match(store, key, entrants)
    races = len(match.races)
    if not number and races == 1:
        number = "0"
    if not number.isdecimal() or int(number) >= races:
        raise InputError(
            f"{store.name}: race is {number!r} of match {key[:10]}, expected KEY:RACE with a race "
            f"from 0 to {races - 1}"
        )
    [log] = _record(match, [int(number)], entrants)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{key[:10]}-{number}.mcap"
        write_recording(path, log)
    except OSError as error:
        raise InputError(f"{folder}: the recording cannot be written: {error.strerror}") from None
    return path


def _find(store: Store, prefix: str) -> str:
    if prefix and store.has(prefix):
        return prefix
    keys = store.results()["match"].unique().to_list()
    found = [key for key in keys if prefix and key.startswith(prefix.lower())]
    if len(found) != 1:
        raise InputError(
            f"{store.name}: {len(found) or 'no'} matches begin with {prefix!r}, expected the key of one, "
            "or its first digits"
        )
    return str(found[0])


def _match(store: Store, key: str, entrants: pl.DataFrame) -> Match:
    return Match.from_spec(store.spec(key), dict(entrants.select("entrant", "source").iter_rows()))


def _record(match: Match, races: Sequence[int], entrants: pl.DataFrame) -> list[RaceLog]:
    names = dict(entrants.select("entrant", "name").iter_rows())
    return record_races(
        match, match_policies(match), races, [names.get(entrant, entrant) for entrant in match.entrants]
    )
