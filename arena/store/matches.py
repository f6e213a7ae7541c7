"""Matches in a store: whole, never twice, and each with a digest of what was stored."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import polars as pl
import sqlalchemy as sa

from nathlon.arena.results import RESULTS
from nathlon.arena.store import schema
from nathlon.arena.store.database import insert_new


def digest(key: str, stage: str, spec: str, columns: Mapping[str, Sequence[Any]]) -> str:
    """SHA-256 in hexadecimal of a match as JSON in ASCII, without white space: [key, stage, spec, columns].

    Columns is an object of lists, by name in order of the names, of rows in order of race and car. A
    float is the shortest decimal that reads back as it. Columns without values are left out, so one that
    is added later, null in all older matches, leaves their digests as they are.
    """
    filled = {name: values for name, values in columns.items() if any(v is not None for v in values)}
    text = json.dumps([key, stage, spec, filled], sort_keys=True, separators=(",", ":"), default=repr)
    return hashlib.sha256(text.encode()).hexdigest()


def stored_digest(connection: sa.Connection, match: sa.Row) -> tuple[int, str]:
    """The number of a match's result rows, and the digest that it has by what is stored now."""
    table = schema.result
    query = sa.select(table).where(table.c.match == match.key).order_by(table.c.race, table.c.car)
    rows = connection.execute(query).all()
    columns = dict(zip(table.c.keys(), zip(*rows, strict=True), strict=bool(rows)))
    return len(rows), digest(match.key, match.stage, match.spec, columns)


def stored(connection: sa.Connection, keys: Iterable[str]) -> set[str]:
    """Those of the keys whose matches are stored."""
    key = schema.match.c.key
    return {
        found
        for chunk in schema.chunks(keys)
        for found in connection.scalars(sa.select(key).where(key.in_(chunk)))
    }


def require(connection: sa.Connection, keys: Collection[str]) -> None:
    """KeyError that names the first of the keys whose match is not stored."""
    there = stored(connection, keys)
    for key in keys:
        if key not in there:
            raise KeyError(key)


class Finished(NamedTuple):
    """A match that has been run.

    Attributes:
        key: of the match.
        stage: for which it was run.
        spec: what decides its outcome, plain JSON values.
        results: RESULTS.
        processor: kind of processor that ran it, see `nathlon.arena.processor`; None where that is not known.
    """

    key: str
    stage: str
    spec: dict[str, Any]
    results: pl.DataFrame
    processor: str | None = None


def check(match: Finished) -> None:
    """Raise ValueError where results are not those of their match."""
    schema.check("result", match.results, RESULTS)
    if {*match.results["match"]} - {match.key} or {*match.results["stage"]} - {match.stage}:
        raise ValueError(
            f"results of match {match.key}: every row must name this match and stage {match.stage}"
        )
    cars = list(zip(match.results["race"], match.results["car"], strict=True))
    if len({*cars}) < len(cars):
        raise ValueError(f"results of match {match.key}: a car has more than one row in a race")


def add(connection: sa.Connection, finished: Sequence[Finished]) -> set[str]:
    """Store matches, which nobody then claims or wants; the keys of those that were not there."""
    once = {match.key: match for match in finished}
    frame = pl.concat([pl.DataFrame(schema=RESULTS), *(match.results for match in once.values())])
    numbers = pl.col(pl.Float64)
    # SQLite does not keep the sign of zero, and polars at times not that 0.0 is added.
    unsigned = pl.when(numbers == 0.0).then(0.0).otherwise(numbers.fill_nan(None)).name.keep()
    frame = frame.with_columns(unsigned).sort("race", "car")
    results = frame.partition_by("match", as_dict=True)
    # In one order, or two who store the same matches at once wait for each other for ever.
    rows = [_row(once[key], results.get((key,), frame.clear())) for key in sorted(once)]
    statement = insert_new(connection, schema.match).returning(schema.match.c.key)
    new = set(connection.scalars(statement, rows))
    schema.insert_frame(connection, schema.result, frame.filter(pl.col("match").is_in(new)))
    for table in (schema.claim, schema.queue):
        connection.execute(table.delete().where(table.c.match.in_(new)))
    return new


def forget(connection: sa.Connection, keys: Iterable[str]) -> None:
    """Take matches out of the store, and out of the runs that used them."""
    for chunk in schema.chunks(keys):
        for column in (schema.result.c.match, schema.run_match.c.match, schema.match.c.key):
            connection.execute(column.table.delete().where(column.in_(chunk)))


def _row(match: Finished, results: pl.DataFrame) -> dict[str, Any]:
    spec = schema.to_json(match.spec)
    found = digest(match.key, match.stage, spec, results.to_dict(as_series=False))
    return {
        "key": match.key,
        "stage": match.stage,
        "spec": spec,
        "rows": results.height,
        "digest": found,
        "processor": match.processor,
    }


def processors(connection: sa.Connection, keys: Collection[str]) -> dict[str, str | None]:
    """The kind of processor that ran each match, in their order; KeyError where one is not stored."""
    require(connection, keys)
    match = schema.match.c
    found: dict[str, str | None] = {}
    for chunk in schema.chunks(keys):
        rows = connection.execute(sa.select(match.key, match.processor).where(match.key.in_(chunk)))
        found |= {row.key: row.processor for row in rows}
    return {key: found[key] for key in keys}


def spec(connection: sa.Connection, key: str) -> dict[str, Any]:
    """What decides the outcome of a match; KeyError where it is not stored."""
    text = connection.scalar(sa.select(schema.match.c.spec).where(schema.match.c.key == key))
    if text is None:
        raise KeyError(key)
    return schema.from_json(text)


def results(connection: sa.Connection, stage: str | None) -> pl.DataFrame:
    """RESULTS of all matches, or of one stage's, ordered by stage, match, race and car."""
    query = sa.select(schema.result)
    if stage is not None:
        query = query.where(schema.result.c.stage == stage)
    return schema.read_frame(connection, query, RESULTS).sort("stage", "match", "race", "car")


def results_of(connection: sa.Connection, keys: Collection[str]) -> pl.DataFrame:
    """RESULTS of these matches, in their order, each once; KeyError where one is not stored."""
    require(connection, keys)
    return pl.concat(
        [pl.DataFrame(schema=RESULTS), *(_results_of(connection, chunk) for chunk in schema.chunks(keys))]
    )


def _results_of(connection: sa.Connection, keys: list[str]) -> pl.DataFrame:
    order = pl.DataFrame({"match": keys, "position": range(len(keys))})
    query = sa.select(schema.result).where(schema.result.c.match.in_(keys))
    frame = schema.read_frame(connection, query, RESULTS).join(order, on="match")
    return frame.sort("position", "race", "car").select(RESULTS.names())


def disagreements(connection: sa.Connection) -> Iterator[str]:
    """A sentence for each match that is not as it was when it was stored."""
    match, result = schema.match, schema.result
    for row in connection.execute(sa.select(match).order_by(match.c.key)).all():
        rows, found = stored_digest(connection, row)
        if rows != row.rows:
            yield f"match {row.key}: {rows} result rows; expected the {row.rows} that were stored"
        elif found != row.digest:
            yield f"match {row.key}: its results or its spec are not those that were stored"
    lost = sa.select(result.c.match).where(result.c.match.not_in(sa.select(match.c.key))).distinct()
    for key in connection.scalars(lost.order_by(result.c.match)):
        yield f"match {key}: result rows without a match"
