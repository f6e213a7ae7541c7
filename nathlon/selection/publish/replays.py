"""Races run again from the store, recorded and made to be looked at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from nathlon.arena.pool import Pool
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recording import read_recording, recording_name, write_recording
from nathlon.arena.store import Store
from nathlon.reports.player import write_player
from nathlon.results.summary import Replay, Summary
from nathlon.selection.publish.clips import clips
from nathlon.selection.publish.decider import DRIVEN, Notable, notable_races
from nathlon.selection.publish.output import RACES, OutputFolder
from nathlon.selection.publish.recordings import run_again, stored_match
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import writing

FINAL = "final"
"""What the files of the deciding race are called; those of others are called after match and race."""


class Replays(NamedTuple):
    """What there is to look at: races, and the logs of those that are recorded."""

    races: tuple[Replay, ...]
    logs: tuple[RaceLog, ...]

    @property
    def facts(self) -> dict[str, Any]:
        """What the summary says of them."""
        first = next(iter(self.races), None)
        return {
            "replays": self.races,
            "recording": first and first.recording,
            "replay": first and first.replay,
        }


def record_replays(
    store: Store,
    results: pl.DataFrame,
    tables: Mapping[str, pl.DataFrame],
    output: OutputFolder,
    pool: Pool,
) -> Replays:
    """Run the notable races of a tournament again, but for those whose recordings are there already.

    Every race leaves a recording (.mcap) and a page that plays it (.html); the deciding one, as `final`, also
    a Rerun replay (.rrd), which `nathlon replay` makes of any other.
    """
    notable = notable_races(results, tables["ranking"])
    names = [recording_name(one.match, one.race) for one in notable]
    if not (results["stage"] == DRIVEN).any():
        names[:1] = [f"{FINAL}.mcap"]
    kept = [_kept(output.races / name, one, results) for name, one in zip(names, notable, strict=False)]
    lost = [one for one, log in zip(notable, kept, strict=True) if log is None]
    again, missing = _run_again(store, lost, tables["entrants"], pool)
    replays, logs = [], []
    for one, name, old in zip(notable, names, kept, strict=False):
        replay = Replay(**one._asdict(), missing=missing.get(one.match))
        log = old or again.get((one.match, one.race))
        if log is not None:
            files = _files(log, output, name, fresh=old is None)
            replay = replay.model_copy(update={**files, "clips": tuple(clips(log)), "missing": None})
            logs.append(log)
        replays.append(replay)
    return Replays(tuple(replays), tuple(logs))


def kept_replays(summary: Summary, results: pl.DataFrame, folder: Path) -> Replays:
    """A summary's races to look at that belong to the results, with what is there of their recordings.

    Args:
        summary: that the folder's report was made with.
        results: RESULTS of the run as it stands.
        folder: of the run.
    """
    matches = set(results["match"])
    races = tuple(race for race in summary.replays if race.match in matches)
    logs = [
        _kept(folder / RACES / Path(race.recording).name, race, results)
        for race in races
        if race.recording and race.video is None
    ]
    return Replays(races, tuple(log for log in logs if log is not None))


def _kept(path: Path, race: Notable | Replay, results: pl.DataFrame) -> RaceLog | None:
    """The race in a file, if it is this one and came out like this."""
    if not path.exists():
        return None
    try:
        log = read_recording(path)
    except InputError:
        return None
    if (log.match, log.race) != (race.match, race.race):
        return None
    raced = results.filter((pl.col("match") == race.match) & (pl.col("race") == race.race)).sort("car")
    came = log.samples["distance_m"][-1]
    return log if np.allclose(came, raced["distance_m"].to_numpy(), rtol=0.0, atol=1e-6) else None


def _run_again(
    store: Store, races: Sequence[Notable], entrants: pl.DataFrame, pool: Pool
) -> tuple[dict[tuple[str, int], RaceLog], dict[str, str]]:
    """Logs by match and race, and by match why there are none."""
    wanted: dict[str, list[int]] = {}
    for race in races:
        wanted.setdefault(race.match, []).append(race.race)
    logs: dict[tuple[str, int], RaceLog] = {}
    missing: dict[str, str] = {}
    for match, answer in run_again(store, wanted, entrants, pool):
        if isinstance(answer, InputError):
            missing[match] = str(answer)
        else:
            logs |= {(log.match, log.race): log for log in answer}
    return logs, missing


def _files(log: RaceLog, output: OutputFolder, name: str, fresh: bool) -> dict[str, str]:
    """Write what a race leaves, and say where; a recording that is not fresh is there."""
    recording = output.races / name
    player = output.replays / f"{recording.stem}.html"
    if fresh:
        write_recording(recording, log)
    write_player(log, player)
    written = {"recording": f"../races/{recording.name}", "player": f"../replays/{player.name}"}
    if recording.stem == FINAL:
        replay = output.replays / f"{FINAL}.rrd"
        if fresh or not replay.exists():
            from nathlon.reports.replay import write_replay  # Rerun takes seconds to load

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
    races = len(stored_match(store, key, entrants).races)
    if not number and races == 1:
        number = "0"
    if not number.isdecimal() or int(number) >= races:
        raise InputError(
            f"{store.name}: race is {number!r} of match {key[:10]}, expected KEY:RACE with a race "
            f"from 0 to {races - 1}"
        )
    with writing(folder, "recording"):
        folder.mkdir(parents=True, exist_ok=True)
    with Pool(1) as pool:
        [(_, answer)] = run_again(store, {key: [int(number)]}, entrants, pool, folder)
    if isinstance(answer, InputError):
        raise answer
    return folder / recording_name(key, int(number))


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
