"""Recordings of stored races, which are run again for them: a match's key says all that decides it."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal

import polars as pl

from nathlon.arena.engine import Records
from nathlon.arena.job import Wanted
from nathlon.arena.match import Match
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recording import recording_name
from nathlon.arena.store import Store
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.run import RECORDINGS, OnMatch
from nathlon.sim.errors import InputError
from nathlon.sim.names import as_named

log = logging.getLogger(__name__)

Kept = Literal["notable", "all"]
"""Which races of a tournament leave a recording: those to look at, or every one."""


def record_tournament(
    store: Store, run: str, output: OutputFolder, recorder: Records, on_match: OnMatch
) -> None:
    """Leave a recording of every race of a run's tournament; those that are there are not run again.

    In another world there is nothing that could be recorded. Why one cannot be recorded is logged.

    Args:
        store: that holds the run.
        run: its name.
        output: where the recordings go.
        recorder: runs the matches.
        on_match: told about progress.
    """
    entrants = store.table(run, "entrants")
    if not any(entrants["circuit"]):
        return
    results = store.results_of_run(run, "tournament")
    wanted: dict[str, list[int]] = {}
    for match, race in results.select("match", "race").unique(maintain_order=True).iter_rows():
        if not (output.races / recording_name(match, race)).exists():
            wanted.setdefault(match, []).append(race)
    on_match(RECORDINGS, 0, len(wanted))
    for done, (_, answer) in enumerate(run_again(store, wanted, entrants, recorder, output.races), 1):
        if isinstance(answer, InputError):
            log.warning("%s", answer)
        on_match(RECORDINGS, done, len(wanted))


def run_again(
    store: Store,
    races: Mapping[str, Sequence[int]],
    entrants: pl.DataFrame,
    recorder: Records,
    folder: Path | None = None,
) -> Iterator[tuple[str, list[RaceLog] | InputError]]:
    """Run stored matches once more, and keep some of their races if they end as they are stored.

    Args:
        store: that holds the matches.
        races: by match, which of its races are to be kept.
        entrants: schema ENTRANTS, of all that race in them.
        recorder: runs the matches.
        folder: where it leaves the recordings instead of giving the logs back.

    Yields:
        a match's key and the logs of its races, or an InputError where its policies cannot be loaded, the
        simulator has changed, it ended otherwise, or a recording cannot be written.
    """
    ran_on = store.processors(races)
    names = dict(entrants.select("entrant", "name").iter_rows())
    wanted = []
    for key, numbers in races.items():
        try:
            match = stored_match(store, key, entrants)
        except InputError as error:
            # The program or a checkpoint is another one by now.
            yield key, error
            continue
        called = tuple(names.get(entrant, entrant) for entrant in match.entrants)
        results = store.results_of([key])
        wanted.append(Wanted(match, tuple(numbers), called, results, folder, processor=ran_on[key]))
    for match, answer in recorder.record(wanted):
        yield match.key, answer if isinstance(answer, InputError) else answer.logs


def stored_match(store: Store, key: str, entrants: pl.DataFrame) -> Match:
    """A match of the store, to be run by the policies of these entrants (ENTRANTS).

    Raises:
        InputError: if the simulator has changed.
    """
    written = entrants.select("entrant", "source").iter_rows()
    return Match.from_spec(store.spec(key), {entrant: as_named(source) for entrant, source in written})
