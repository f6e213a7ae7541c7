"""A queue of wanted matches, the files that go with them, and who is at work.

Revision ID: 0004
Revises: 0003
"""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"

RUNNING_NUMBER = sa.BigInteger().with_variant(sa.Integer, "sqlite")


def upgrade() -> None:
    op.create_table(
        "worker",
        sa.Column("owner", sa.Text, primary_key=True),
        sa.Column("processes", sa.BigInteger, nullable=False),
        sa.Column("until", sa.Text, nullable=False),
    )
    op.create_table(
        "surroundings",
        sa.Column("digest", sa.Text, primary_key=True),
        sa.Column("facts", sa.Text, nullable=False),
    )
    op.create_table(
        "queue",
        sa.Column("id", RUNNING_NUMBER, primary_key=True),
        sa.Column("match", sa.Text, nullable=False, unique=True),
        sa.Column("surroundings", sa.Text, sa.ForeignKey("surroundings.digest"), nullable=False),
        sa.Column("spec", sa.Text, nullable=False),
        sa.Column("sources", sa.Text, nullable=False),
    )
    op.create_index("ix_queue_surroundings_id", "queue", ["surroundings", "id"])
    op.create_table(
        "file",
        sa.Column("digest", sa.Text, primary_key=True),
        sa.Column("content", sa.LargeBinary, nullable=False),
    )
