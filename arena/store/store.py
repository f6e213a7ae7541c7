"""The store of many selections: finished matches, runs that used them, claims on others, and a log."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import polars as pl

from nathlon.arena.results import TABLES
from nathlon.arena.store import claims, copying, files, log, matches, opening, queue, runs, schema
from nathlon.arena.store.claims import WorkerRecord
from nathlon.arena.store.database import Database
from nathlon.arena.store.log import LogEntry
from nathlon.arena.store.matches import Finished
from nathlon.arena.store.queue import Queued
from nathlon.arena.store.runs import FoundEntrant, RunRecord
from nathlon.arena.store.schema import JsonValue


class Store:
    """Matches with their results; runs with their stage tables and facts; claims; the log.

    Every method is one transaction: it happens whole or not at all, also beside other processes and
    threads. NaN is kept as null. A frame that does not have the table's schema raises ValueError, a match
    or a run that is not there KeyError; a database that cannot be used raises InputError.
    """

    def __init__(self, target: Path | str, *, must_exist: bool = False) -> None:
        """Use the store in the SQLite file at a path, or in the PostgreSQL database at a URL.

        A new one is made where the file is missing or the database empty, unless it must exist; an older
        one is brought up to date, after a copy of the file.

        Raises InputError where there is something else, a store of a newer version, or nothing that can
        be used, or another process holds it for longer than 30 s. A file that cannot be written here can
        be read all the same.
        """
        self._database = Database(target)
        try:
            opening.prepare(self._database, must_exist)
        except BaseException:
            self.close()
            raise

    @classmethod
    def open(cls, target: Path | str) -> Store:
        """Use an existing store; InputError where there is none."""
        return cls(target, must_exist=True)

    @property
    def name(self) -> str:
        """The path, or the URL without its password."""
        return self._database.name

    @property
    def shared(self) -> bool:
        """Whether other machines can reach it: it is in PostgreSQL."""
        return self._database.path is None

    @property
    def read_only(self) -> bool:
        """Whether it is a file that cannot be written, or lies in a folder that cannot."""
        return self._database.read_only

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._database.close()

    def copy_to(self, other: Store, on_match: Callable[[int, int], None] = lambda done, total: None) -> int:
        """Copy matches, runs and the log into another store, and count the matches.

        A copy that was stopped goes on.

        Claims, the queue and its files stay. Every match is checked on arrival.

        Args:
            other: a new store.
            on_match: told how many matches are there, and how many there are in all.

        Raises:
            InputError: if the other holds runs, or a match is not as it was stored.
        """
        return copying.copy(self._database, other._database, on_match)

    # Matches

    def has(self, key: str) -> bool:
        """Whether the match with this key is stored."""
        return bool(self.stored([key]))

    def stored(self, keys: Iterable[str]) -> set[str]:
        """Those of the keys whose matches are stored."""
        return self._database.read(matches.stored, list(keys))

    def add_match(self, key: str, stage: str, spec: dict[str, Any], results: pl.DataFrame) -> bool:
        """Store a finished match, which nobody claims or wants then; False, and no change, if it is there."""
        return bool(self.add_matches([Finished(key, stage, spec, results)]))

    def add_matches(self, finished: Sequence[Finished]) -> set[str]:
        """Store finished matches as `add_match` does, all at once; the keys of those that were not there."""
        for match in finished:
            matches.check(match)
        return self._database.write(matches.add, finished)

    def forget(self, keys: Iterable[str]) -> None:
        """Take matches out, also out of the runs that used them, so that they are run again."""
        self._database.write(matches.forget, list(keys))

    def spec(self, key: str) -> dict[str, Any]:
        """What decides the outcome of a match."""
        return self._database.read(matches.spec, key)

    def processors(self, keys: Iterable[str]) -> dict[str, str | None]:
        """The kind of processor that ran each match, in their order; None where that is not known."""
        return self._database.read(matches.processors, list(dict.fromkeys(keys)))

    def results(self, stage: str | None = None) -> pl.DataFrame:
        """RESULTS of all matches, or of one stage's, ordered by stage, match, race and car."""
        return self._database.read(matches.results, stage)

    def results_of(self, keys: Iterable[str]) -> pl.DataFrame:
        """RESULTS of these matches, in their order, each once, and in it by race and car."""
        return self._database.read(matches.results_of, list(dict.fromkeys(keys)))

    def verify(self) -> list[str]:
        """A sentence for everything that is not as it was stored; none where all is well.

        Numbers of rows and digests of all matches are made anew from their rows, and SQLite checks its file.
        """
        with self._database.reading() as connection:
            return [*opening.file_faults(connection), *matches.disagreements(connection)]

    # Runs

    def begin_run(self, name: str, config: dict[str, Any]) -> RunRecord:
        """Begin a run, or go on with the one of this name.

        Raises InputError where that was begun with another configuration.
        """
        return self._database.write(runs.begin, name, config)

    def end_run(self, name: str, status: str) -> None:
        """Say that a run has ended, and as what."""
        self._database.write(runs.end, name, status)

    def runs(self) -> list[RunRecord]:
        """All runs, in the order in which they began."""
        return self._database.read(runs.records)

    def use(self, run: str, keys: Iterable[str]) -> None:
        """Note that a run used these matches, in this order, after those that it used before."""
        self._database.write(runs.use, run, list(dict.fromkeys(keys)))

    def leave(self, run: str, keys: Iterable[str]) -> None:
        """Note that a run does not use these matches after all; they stay stored."""
        self._database.write(runs.leave, run, list(keys))

    def results_of_run(self, run: str, stage: str | None = None) -> pl.DataFrame:
        """RESULTS of the matches that a run used, or of one stage's, in the order in which it used them."""
        return self._database.read(runs.results, run, stage)

    def interrupted(self, run: str) -> set[str]:
        """Keys of the matches that a run used and that the machine has interrupted."""
        return self._database.read(runs.interrupted, run)

    def put_table(self, run: str, name: str, frame: pl.DataFrame) -> None:
        """Replace a stage table of a run, one of `nathlon.arena.results.TABLES`."""
        schema.check(name, frame, TABLES[name])
        self._database.write(runs.put_table, run, name, frame)

    def table(self, run: str, name: str) -> pl.DataFrame:
        """A stage table of a run as it was put; empty where it never was."""
        return self._database.read(runs.table, run, name)

    def put_fact(self, run: str, key: str, value: JsonValue) -> None:
        """Keep a fact about a run, instead of the one that had this key."""
        self._database.write(runs.put_fact, run, key, value)

    def fact_of_runs(self, key: str) -> dict[str, JsonValue]:
        """One fact of all runs that have it, by their names in the order in which they began."""
        return self._database.read(runs.fact_of_runs, key)

    def facts(self, run: str) -> dict[str, JsonValue]:
        """All facts about a run, ordered by key."""
        return self._database.read(runs.facts, run)

    def find_entrants(self, text: str, most: int) -> list[FoundEntrant]:
        """Entrants of all runs with a text in their name, source or id, the latest run's first."""
        return self._database.read(runs.find_entrants, text, most)

    # Claims

    def claim(self, keys: Sequence[str], owner: str, for_s: float) -> list[str]:
        """Claim matches to run them; those that were granted, in their order.

        A match that is stored, or that another owner has a claim on which has not run out, is not granted.
        An owner renews its claims by claiming again, and learns from the answer which it has lost.

        Args:
            keys: of the matches.
            owner: who asks; no two processes may give the same name.
            for_s: how long the claims last, unless they are renewed, s; at most 600.
        """
        return self._database.write(claims.grant, keys, owner, for_s)

    def drop(self, keys: Sequence[str], owner: str) -> None:
        """Drop an owner's claims on some matches."""
        self._database.write(claims.drop, keys, owner)

    def release(self, owner: str) -> None:
        """Drop all claims of an owner, who is no longer at work."""
        self._database.write(claims.release, owner)

    def owners(self) -> list[str]:
        """All who hold a claim or are at work, or have let that expire."""
        return self._database.read(claims.owners)

    def attend(self, owner: str, processes: int, for_s: float, ran: int = 0) -> None:
        """Note that an owner is at work with so many processes, and renew all its claims.

        Args:
            owner: as for `claim`.
            processes: of this machine that run matches for it.
            for_s: how long this holds, s; at most 600.
            ran: matches that it has run so far.
        """
        self._database.write(claims.attend, owner, processes, for_s, ran)

    def workers(self) -> list[WorkerRecord]:
        """Owners that are at work, and those that have not said that they have ended."""
        return self._database.read(claims.workers)

    def at_work(self) -> dict[str, int]:
        """Owners that are at work, each with the number of its processes."""
        return self._database.read(claims.at_work)

    # The queue

    def enqueue(self, wanted: Sequence[Queued], surroundings: Mapping[str, Any]) -> None:
        """Append wanted matches to the queue, except those that are stored or in it.

        Args:
            wanted: the matches, in the order in which they shall be run.
            surroundings: what decides their outcomes beside them, as plain JSON values, by a digest of it.
        """
        self._database.write(queue.put, wanted, surroundings)

    def waiting(self, most: int = queue.COUNTED, unclaimed: bool = False) -> dict[str, int]:
        """How many matches are in the queue, by digest of their surroundings.

        Args:
            most: more than these of the same count as so many.
            unclaimed: leave out those that somebody has claimed.
        """
        return self._database.read(queue.waiting, most, unclaimed)

    def surroundings(self, digest: str) -> Any:
        """What decides the outcomes of some wanted matches beside them; nothing of it has been checked.

        Raises:
            KeyError: if there are none of this digest.
        """
        return self._database.read(queue.surroundings, digest)

    def take(
        self, surroundings: str, owner: str, most: int, for_s: float, but: Iterable[str] = ()
    ) -> list[Queued]:
        """Claim the first matches in the queue that nobody has claimed.

        Args:
            surroundings: digest of theirs; such matches can run together.
            owner, for_s: as for `claim`.
            most: how many, at most.
            but: keys of those that the owner cannot run.
        """
        return self._database.write(queue.take, surroundings, owner, most, for_s, list(but))

    def withdraw(self, keys: Iterable[str]) -> None:
        """Take matches out of the queue: nobody wants them any more."""
        self._database.write(queue.remove, list(keys))

    def withdraw_surroundings(self, digest: str) -> None:
        """Take surroundings out that are damaged, and the matches in the queue that have them."""
        self._database.write(queue.remove_surroundings, digest)

    # Files

    def files(self, digests: Iterable[str]) -> set[str]:
        """Those of the digests (SHA-256 in hexadecimal) whose files are kept here; they count as used now."""
        return self._database.write(files.held, list(digests))

    def put_file(self, digest: str, content: bytes) -> None:
        """Keep a file by its digest."""
        self._database.write(files.put, digest, content)

    def file(self, digest: str) -> bytes:
        """A file by its digest, as it is kept: whoever asks checks it."""
        return self._database.read(files.get, digest)

    def remove_files(self, unused_for_s: float) -> tuple[int, int]:
        """Remove files that no match in the queue names; how many, and their bytes.

        Args:
            unused_for_s: since they were put or asked for, at least, s: who wants matches sees to their files
                before it puts them into the queue.
        """
        return self._database.write(files.remove_unused, unused_for_s)

    # The log

    def append(self, kind: str, entry: dict[str, Any], run: str | None = None) -> LogEntry:
        """Append an entry to the log, for good: the database refuses to change or delete it."""
        return self._database.write_once(log.append, kind, entry, run)

    def log(self, kind: str | None = None, run: str | None = None) -> list[LogEntry]:
        """All entries, or those of a kind, of a run, or both, in the order in which they were appended."""
        return self._database.read(log.entries, kind, run)

    def last_of(self, kind: str) -> LogEntry | None:
        """The last entry of a kind; None where there is none."""
        return self._database.read(log.last, kind)
