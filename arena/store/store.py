"""The store of many selections: finished matches, runs that used them, claims on others, and a log."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import polars as pl

from nathlon.arena.results import RESULTS, TABLES
from nathlon.arena.store import claims, log, matches, opening, runs, schema
from nathlon.arena.store.database import Database
from nathlon.arena.store.log import LogEntry
from nathlon.arena.store.runs import RunRecord
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

    # Matches

    def has(self, key: str) -> bool:
        """Whether the match with this key is stored."""
        return bool(self.stored([key]))

    def stored(self, keys: Iterable[str]) -> set[str]:
        """Those of the keys whose matches are stored."""
        with self._database.reading() as connection:
            return matches.stored(connection, keys)

    def add_match(self, key: str, stage: str, spec: dict[str, Any], results: pl.DataFrame) -> bool:
        """Store a finished match, and drop the claim on it; False, and no change, where its key is there."""
        schema.check("result", results, RESULTS)
        named = pl.col("match").eq_missing(key) & pl.col("stage").eq_missing(stage)
        if not results.select(named.all()).item():
            raise ValueError(f"results of match {key}: every row must name this match and stage {stage}")
        if results.select(pl.struct("race", "car").is_duplicated().any()).item():
            raise ValueError(f"results of match {key}: a car has more than one row in a race")
        with self._database.writing() as connection:
            return matches.add(connection, key, stage, spec, results)

    def spec(self, key: str) -> dict[str, Any]:
        """What decides the outcome of a match."""
        with self._database.reading() as connection:
            return matches.spec(connection, key)

    def results(self, stage: str | None = None) -> pl.DataFrame:
        """RESULTS of all matches, or of one stage's, ordered by stage, match, race and car."""
        with self._database.reading() as connection:
            return matches.results(connection, stage)

    def results_of(self, keys: Iterable[str]) -> pl.DataFrame:
        """RESULTS of these matches, in their order, each once, and in it by race and car."""
        with self._database.reading() as connection:
            return matches.results_of(connection, list(dict.fromkeys(keys)))

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
        with self._database.writing() as connection:
            return runs.begin(connection, name, config)

    def end_run(self, name: str, status: str) -> None:
        """Say that a run has ended, and as what."""
        with self._database.writing() as connection:
            runs.end(connection, name, status)

    def runs(self) -> list[RunRecord]:
        """All runs, in the order in which they began."""
        with self._database.reading() as connection:
            return runs.records(connection)

    def use(self, run: str, keys: Iterable[str]) -> None:
        """Note that a run used these matches, in this order, after those that it used before."""
        with self._database.writing() as connection:
            runs.use(connection, run, list(dict.fromkeys(keys)))

    def results_of_run(self, run: str, stage: str | None = None) -> pl.DataFrame:
        """RESULTS of the matches that a run used, or of one stage's, in the order in which it used them."""
        with self._database.reading() as connection:
            return runs.results(connection, run, stage)

    def put_table(self, run: str, name: str, frame: pl.DataFrame) -> None:
        """Replace a stage table of a run, one of `nathlon.arena.results.TABLES`."""
        schema.check(name, frame, TABLES[name])
        with self._database.writing() as connection:
            runs.put_table(connection, run, name, frame)

    def table(self, run: str, name: str) -> pl.DataFrame:
        """A stage table of a run as it was put; empty where it never was."""
        with self._database.reading() as connection:
            return runs.table(connection, run, name)

    def put_fact(self, run: str, key: str, value: JsonValue) -> None:
        """Keep a fact about a run, in place of the one that had this key."""
        with self._database.writing() as connection:
            runs.put_fact(connection, run, key, value)

    def facts(self, run: str) -> dict[str, JsonValue]:
        """All facts about a run, ordered by key."""
        with self._database.reading() as connection:
            return runs.facts(connection, run)

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
        with self._database.writing() as connection:
            return claims.grant(connection, keys, owner, for_s)

    def release(self, owner: str) -> None:
        """Drop all claims of an owner."""
        with self._database.writing() as connection:
            claims.release(connection, owner)

    def owners(self) -> list[str]:
        """All who hold a claim, or have let one expire."""
        with self._database.reading() as connection:
            return claims.owners(connection)

    # The log

    def append(self, kind: str, entry: dict[str, Any], run: str | None = None) -> LogEntry:
        """Append an entry to the log, for good: the database refuses to change or delete it."""
        with self._database.writing() as connection:
            return log.append(connection, kind, entry, run)

    def log(self, kind: str | None = None, run: str | None = None) -> list[LogEntry]:
        """All entries, or those of a kind, of a run, or both, in the order in which they were appended."""
        with self._database.reading() as connection:
            return log.entries(connection, kind, run)
