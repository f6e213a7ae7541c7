"""Runs in a store: selections, the matches that each used, and its stage tables and facts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl
import sqlalchemy as sa

from nathlon.arena.results import INTERRUPTED, RESULTS, TABLES
from nathlon.arena.store import matches, schema
from nathlon.arena.store.database import StoreFault, clock, insert_new, stamp

RUNNING = "running"


@dataclass(frozen=True)
class RunRecord:
    """A selection.

    Attributes:
        began_at: UTC, ISO 8601.
        ended_at: UTC, ISO 8601; None while it has not ended. Never before it began, whatever the clock did.
        status: "running", or what it was said to have ended as.
        config: all that it was begun with, as plain JSON values.
    """

    id: int
    name: str
    began_at: str
    ended_at: str | None
    status: str
    config: dict[str, Any]


@dataclass(frozen=True)
class FoundEntrant:
    """An entrant of a run, and how far it came there.

    Attributes:
        run: its name.
        began_at: of the run, UTC, ISO 8601.
        survives: whether it came through the filter; None where it was not filtered.
        skill: n-athlon points; None where it was not tested.
        rank, points_per_race, points_low, points_high: of the round robin; None where it was not in it.
    """

    run: str
    began_at: str
    entrant: str
    name: str
    source: str
    algorithm: str
    step: int | None
    survives: bool | None
    skill: float | None
    rank: int | None
    points_per_race: float | None
    points_low: float | None
    points_high: float | None


def begin(connection: sa.Connection, name: str, config: dict[str, Any]) -> RunRecord:
    """Begin a run, or go on with the one of this name if it was begun with the same configuration."""
    text = schema.to_json(config)
    row = {"name": name, "began_at": stamp(clock(connection)), "status": RUNNING, "config": text}
    connection.execute(insert_new(connection, schema.run), row)
    _update(connection, name, ended_at=None, status=RUNNING)
    record = _record(connection.execute(sa.select(schema.run).where(schema.run.c.name == name)).one())
    if schema.to_json(record.config) != text:
        raise StoreFault(
            f"run {name} was begun with another configuration; expected the same, or another name"
        )
    return record


def end(connection: sa.Connection, name: str, status: str) -> None:
    """Say how a run ended, instead of what was said before."""
    began_at = connection.scalar(sa.select(schema.run.c.began_at).where(schema.run.c.name == name))
    _update(connection, name, ended_at=max(stamp(clock(connection)), began_at or ""), status=status)


def records(connection: sa.Connection) -> list[RunRecord]:
    """All runs, in the order in which they began."""
    return [_record(row) for row in connection.execute(sa.select(schema.run).order_by(schema.run.c.id))]


def find(connection: sa.Connection, name: str) -> int:
    """The id of a run; KeyError where there is none of this name."""
    return _id(connection, name, sa.select(schema.run.c.id))


def use(connection: sa.Connection, name: str, keys: Sequence[str]) -> None:
    """Note that a run used these matches, after those that it used before."""
    matches.require(connection, keys)
    table, run = schema.run_match, _hold(connection, name)
    last = connection.scalar(sa.select(sa.func.max(table.c.position)).where(table.c.run == run))
    first = 0 if last is None else last + 1
    rows = [{"run": run, "match": key, "position": first + index} for index, key in enumerate(keys)]
    if rows:
        connection.execute(insert_new(connection, table), rows)


def leave(connection: sa.Connection, name: str, keys: Sequence[str]) -> None:
    """Note that a run does not use these matches after all."""
    table, run = schema.run_match, _hold(connection, name)
    for chunk in schema.chunks(keys):
        connection.execute(table.delete().where(table.c.run == run, table.c.match.in_(chunk)))


def results(connection: sa.Connection, name: str, stage: str | None) -> pl.DataFrame:
    """RESULTS of the matches that a run used, in that order, or of one stage's."""
    used, match, result = schema.run_match, schema.match, schema.result
    query = sa.select(match.c.key, used.c.position).join(used).where(used.c.run == find(connection, name))
    if stage is not None:
        query = query.where(match.c.stage == stage)
    order = schema.read_frame(connection, query, pl.Schema({"match": pl.String, "position": pl.Int64}))
    chosen = sa.select(result).where(result.c.match.in_(query.with_only_columns(match.c.key)))
    frame = schema.read_frame(connection, chosen, RESULTS)
    return frame.join(order, on="match").sort("position", "match", "race", "car").select(RESULTS.names())


def interrupted(connection: sa.Connection, name: str) -> set[str]:
    """Keys of the matches that a run used and that the machine has interrupted."""
    run, used, result = schema.run, schema.run_match, schema.result
    query = sa.select(used.c.match).join(run).join(result, result.c.match == used.c.match)
    query = query.where(run.c.name == name, result.c.ending == INTERRUPTED)
    return set(connection.scalars(query.distinct()))


def put_table(connection: sa.Connection, name: str, table_name: str, frame: pl.DataFrame) -> None:
    """Replace a stage table of a run."""
    table, run = schema.stage_tables[table_name], _hold(connection, name)
    connection.execute(table.delete().where(table.c.run == run))
    schema.insert_frame(connection, table, frame.with_row_index("position").with_columns(run=pl.lit(run)))


def table(connection: sa.Connection, name: str, table_name: str) -> pl.DataFrame:
    """A stage table of a run as it was put; empty where it never was."""
    stored, columns = schema.stage_tables[table_name], TABLES[table_name]
    query = sa.select(*(stored.c[column] for column in columns))
    query = query.where(stored.c.run == find(connection, name)).order_by(stored.c.position)
    return schema.read_frame(connection, query, columns)


def put_fact(connection: sa.Connection, name: str, key: str, value: schema.JsonValue) -> None:
    """Keep a fact about a run, instead of the one that had this key."""
    table, run = schema.fact, _hold(connection, name)
    connection.execute(table.delete().where(table.c.run == run, table.c.key == key))
    connection.execute(table.insert(), {"run": run, "key": key, "value": schema.to_json(value)})


def facts(connection: sa.Connection, name: str) -> dict[str, schema.JsonValue]:
    """All facts about a run, ordered by key."""
    query = sa.select(schema.fact).where(schema.fact.c.run == find(connection, name))
    rows = connection.execute(query)
    return dict(sorted((row.key, schema.from_json(row.value)) for row in rows))


def fact_of_runs(connection: sa.Connection, key: str) -> dict[str, schema.JsonValue]:
    """One fact of all runs that have it, by their names."""
    query = sa.select(schema.run.c.name, schema.fact.c.value).join(schema.fact)
    rows = connection.execute(query.where(schema.fact.c.key == key).order_by(schema.run.c.id))
    return {name: schema.from_json(value) for name, value in rows}


def find_entrants(connection: sa.Connection, text: str, most: int) -> list[FoundEntrant]:
    """Entrants of all runs with a text in their name, source or id, the latest run's first."""
    tables = schema.stage_tables
    entrants, pareto, battery, ranking = (tables[n] for n in ("entrants", "pareto", "battery", "ranking"))
    joined = schema.run.join(entrants, entrants.c.run == schema.run.c.id)
    for stage in (pareto, battery, ranking):
        here = (stage.c.run == entrants.c.run) & (stage.c.entrant == entrants.c.entrant)
        joined = joined.outerjoin(stage, here)
    own = (entrants.c[name] for name in ("entrant", "name", "source", "algorithm", "step"))
    far = (ranking.c[name] for name in ("rank", "points_per_race", "points_low", "points_high"))
    query = sa.select(
        schema.run.c.name, schema.run.c.began_at, *own, pareto.c.survives, battery.c.points, *far
    )
    parts = (entrants.c.name, entrants.c.source, entrants.c.entrant)
    query = query.select_from(joined).where(
        sa.or_(*(part.icontains(text, autoescape=True) for part in parts))
    )
    query = query.order_by(schema.run.c.id.desc(), entrants.c.position).limit(most)
    return [FoundEntrant(*tuple(row)) for row in connection.execute(query)]


def _hold(connection: sa.Connection, name: str) -> int:
    """The id of a run, on which others that write to it wait until the end of the transaction."""
    return _id(connection, name, sa.select(schema.run.c.id).with_for_update())


def _id(connection: sa.Connection, name: str, query: sa.Select) -> int:
    found = connection.scalar(query.where(schema.run.c.name == name))
    if found is None:
        raise KeyError(name)
    return found


def _update(connection: sa.Connection, name: str, **values: str | None) -> None:
    run = _hold(connection, name)
    connection.execute(schema.run.update().where(schema.run.c.id == run), values)


def _record(row: sa.Row) -> RunRecord:
    return RunRecord(**{**row._mapping, "config": schema.from_json(row.config)})
