"""`nathlon.twin`: a recorded race beside one that began alike."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from html import escape
from pathlib import Path
from typing import NamedTuple

import polars as pl

from nathlon.api.candidates import Candidate, one_source
from nathlon.arena.entrance import enter_each
from nathlon.arena.entrant import Entrant
from nathlon.arena.pool import Pool
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recording import read_recording, write_recording
from nathlon.judge.twin.checks import check_moment, check_one_start
from nathlon.judge.twin.rebuild import Rebuilt, rebuild
from nathlon.judge.twin.running import OnRace, race_both, see_again
from nathlon.reports.cars import car_index
from nathlon.reports.twin_page import write_twin_page
from nathlon.results.twin import Side, Twins, outcome
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import check_output, writing
from nathlon.terminal.progress import stage_progress

RACES = "races"
"""What progress counts."""


class TwinResult:
    """Two races side by side, and where they are.

    Attributes:
        folder: of all that it has left.
        page: both races in a player (.html).
        replay: both on one timeline, for Rerun (.rrd).
        original, twin: recordings (.mcap).
        car: index of the car that is looked at.
        parted_s: when the races first differ, s; None if never.
        outcomes: a polars frame, how each race ended for the car: `race`, `driver` and the fields of
            `nathlon.results.twin.TwinOutcome`.
    """

    def __init__(self, folder: Path, twins: Twins) -> None:
        self.folder = folder
        self.page, self.replay = folder / "index.html", folder / "twin.rrd"
        self.original, self.twin = folder / "original.mcap", folder / "twin.mcap"
        self.car, self.parted_s = twins.car, twins.parted_s
        self.outcomes = pl.DataFrame(
            [
                {"race": race, "driver": log.names[twins.car], **outcome(log, twins.car)._asdict()}
                for race, log in (("original", twins.original.log), ("twin", twins.twin.log))
            ]
        )

    def __repr__(self) -> str:
        lines = [
            f"{row['race']}: {row['driver']} comes {row['place']}., {row['ending']}"
            for row in self.outcomes.iter_rows(named=True)
        ]
        same = "to the end" if self.parted_s is None else f"until {self.parted_s:.1f} s"
        return "\n".join([*lines, f"The races are the same {same}", f"Page: {self.page}"])

    def _repr_html_(self) -> str:
        return self.outcomes._repr_html_() + f"<p>{escape(repr(self).splitlines()[-2])}</p>"


def twin(
    recording: str | Path,
    other: str | Path | None = None,
    *,
    car: int | str,
    policy: Candidate | None = None,
    at_s: float = 0.0,
    out: str | Path = "runs/twin",
    store: str | Path | None = None,
    entrants: Mapping[str, Candidate] | None = None,
    progress: bool = True,
) -> TwinResult:
    """A recorded race beside its twin: another policy in a car's place from a moment, or another recording.

    The recorded race is run again, to the bit, and once more with the other policy, which has no memory of
    what was before its moment, and decides from then on when the car stops. What each driver of the car saw
    is kept.

    Args:
        recording: of the race (.mcap).
        other: recording of another race from the same start, instead of `policy`.
        car: start number, from 1, or name of the car.
        policy: who drives it in the twin: a checkpoint, `driver:pace=0.95`, `plugin:NAME` or an object.
        at_s: from when, s since the start.
        out: folder for what it leaves.
        store: that holds the race's match; the one beside the recording by default.
        entrants: policies of the race, by their names in it, where no store knows them.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if the race cannot be run again as it was, the policy cannot drive there, the car or the
            moment is not one of the race, the two races did not begin alike, or the folder cannot be written.
    """
    if (other is None) == (policy is None):
        raise InputError("twin: expected either a policy in the car's place or another recording")
    path, folder = Path(recording), Path(out)
    check_output(folder)
    log = read_recording(path)
    index = car_index(log, str(car), path)
    given = {name: one_source(each, people=True, name=name) for name, each in (entrants or {}).items()}
    known = _RaceSources(store, given)
    with Pool(2) as pool, stage_progress(progress, (RACES,)) as on_match:
        on_race = partial(on_match, RACES)
        if other is not None:
            twins = _two_recordings(pool, (path, Path(other)), index, known, folder, on_race)
        else:
            assert policy is not None, "it is one or the other"
            check_moment(log, path, index, at_s)
            driver = _enter(pool, policy, log)
            rebuilt = known.rebuild(pool, log, path)
            _make(folder)
            twins = Twins(*race_both(pool, rebuilt, log, path, (index, driver, at_s), on_race), index, at_s)
    return _write(twins, folder)


class _RaceSources(NamedTuple):
    """Where matches and policies of recorded races may be: a store that was named, and sources by name."""

    store: str | Path | None
    named: Mapping[str, str]

    def rebuild(self, pool: Pool, log: RaceLog, recording: Path) -> Rebuilt:
        """The match of a race; by default from the store of the run that its recording is part of."""
        beside = recording.resolve().parent.parent / "store.sqlite"
        return rebuild(pool, log, recording, self.store or (beside if beside.exists() else None), self.named)


def _enter(pool: Pool, policy: Candidate, log: RaceLog) -> Entrant:
    [answer] = enter_each(pool, [one_source(policy, people=True)], log.circuit, log.car)
    if isinstance(answer, InputError):
        raise answer
    return answer


def _two_recordings(
    pool: Pool, paths: tuple[Path, Path], car: int, known: _RaceSources, folder: Path, on_race: OnRace
) -> Twins:
    logs = read_recording(paths[0]), read_recording(paths[1])
    check_one_start(*logs, paths)
    _make(folder)
    try:
        rebuilt = [known.rebuild(pool, log, path) for log, path in zip(logs, paths, strict=True)]
        original, twin = see_again(pool, rebuilt, logs, paths, car, on_race)
    except InputError as error:
        # The races can be looked at all the same.
        return Twins(Side(logs[0]), Side(logs[1]), car, missing=str(error))
    return Twins(original, twin, car)


def _make(folder: Path) -> None:
    """Make the folder before races are run for it."""
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)


def _write(twins: Twins, folder: Path) -> TwinResult:
    from nathlon.reports.twin_replay import write_twin_replay  # Rerun takes seconds to load

    result = TwinResult(folder, twins)
    with writing(folder):
        write_recording(result.original, twins.original.log)
        write_recording(result.twin, twins.twin.log)
        write_twin_replay(twins, result.replay)
        write_twin_page(twins, result.page)
    return result
