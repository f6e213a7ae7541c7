"""Many runs to a store, digests of matches, claims, and a log that only grows.

What an older store holds becomes the run "1", which uses all matches.

Revision ID: 0002
Revises: 0001
"""

from collections.abc import Sequence
from datetime import UTC, datetime

import sqlalchemy as sa
from alembic import op

from nathlon.arena.store.matches import digest
from nathlon.arena.store.schema import LOG_TRIGGERS

revision = "0002"
down_revision = "0001"

STAGE_TABLES = ("entrants", "pareto", "skills", "battery", "ranking", "matchups")
RUNNING_NUMBER = sa.BigInteger().with_variant(sa.Integer, "sqlite")


def upgrade() -> None:
    op.create_table(
        "run",
        sa.Column("id", RUNNING_NUMBER, primary_key=True),
        sa.Column("name", sa.Text, nullable=False, unique=True),
        sa.Column("began_at", sa.Text, nullable=False),
        sa.Column("ended_at", sa.Text),
        sa.Column("status", sa.Text, nullable=False),
        sa.Column("config", sa.Text, nullable=False),
    )
    op.create_table(
        "run_match",
        sa.Column("run", RUNNING_NUMBER, sa.ForeignKey("run.id"), primary_key=True, autoincrement=False),
        sa.Column("match", sa.Text, sa.ForeignKey("match.key"), primary_key=True),
        sa.Column("position", sa.BigInteger, nullable=False),
    )
    op.create_table(
        "claim",
        sa.Column("match", sa.Text, primary_key=True),
        sa.Column("owner", sa.Text, nullable=False),
        sa.Column("until", sa.Text, nullable=False),
    )
    op.create_table(
        "log",
        sa.Column("id", RUNNING_NUMBER, primary_key=True),
        sa.Column("at", sa.Text, nullable=False),
        sa.Column("kind", sa.Text, nullable=False, index=True),
        sa.Column("run", RUNNING_NUMBER, sa.ForeignKey("run.id")),
        sa.Column("entry", sa.Text, nullable=False),
    )
    for trigger in LOG_TRIGGERS[op.get_bind().dialect.name]:
        op.execute(trigger)
    _digest_matches()
    _make_run()


def _digest_matches() -> None:
    op.add_column("match", sa.Column("rows", sa.BigInteger))
    op.add_column("match", sa.Column("digest", sa.Text))
    match, result = _table("match"), _table("result")
    for row in _rows(sa.select(match)):
        query = sa.select(result).where(result.c.match == row["key"])
        results = _rows(query.order_by(result.c.race, result.c.car))
        columns = {column.name: [values[column.name] for values in results] for column in result.c}
        found = digest(row["key"], row["stage"], row["spec"], columns)
        change = match.update().where(match.c.key == row["key"])
        op.get_bind().execute(change, {"rows": len(results), "digest": found})
    with op.batch_alter_table("match") as batch:
        batch.alter_column("rows", nullable=False)
        batch.alter_column("digest", nullable=False)


def _make_run() -> None:
    match = _table("match")
    matches = _rows(sa.select(match.c.key).order_by(match.c.stage, match.c.key))
    tables = {name: _rows(sa.select(_table(name))) for name in (*STAGE_TABLES, "fact")}
    if matches or any(tables.values()):
        now = datetime.now(UTC).isoformat(timespec="microseconds")
        status = "finished" if any(fact["key"] == "summary" for fact in tables["fact"]) else "interrupted"
        row = {"id": 1, "name": "1", "began_at": now, "ended_at": now, "status": status, "config": "{}"}
        op.bulk_insert(_table("run"), [row])
        used = [{"run": 1, "match": row["key"], "position": index} for index, row in enumerate(matches)]
        op.bulk_insert(_table("run_match"), used)
    for name, rows in tables.items():
        _rebuild(name, rows)


def _rebuild(name: str, rows: Sequence[sa.RowMapping]) -> None:
    """Make a table again with the run in its key, and its rows those of run 1."""
    first, *others = _table(name).columns
    op.drop_table(name)
    new = op.create_table(
        name,
        sa.Column("run", RUNNING_NUMBER, sa.ForeignKey("run.id"), primary_key=True, autoincrement=False),
        sa.Column(first.name, first.type, primary_key=True, autoincrement=False),
        *(sa.Column(column.name, column.type, nullable=column.nullable) for column in others),
    )
    op.bulk_insert(new, [{**row, "run": 1} for row in rows])


def _table(name: str) -> sa.Table:
    return sa.Table(name, sa.MetaData(), autoload_with=op.get_bind())


def _rows(query: sa.Select) -> Sequence[sa.RowMapping]:
    return op.get_bind().execute(query).mappings().all()
