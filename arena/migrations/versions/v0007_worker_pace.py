"""Since when a worker is at work, when it was last seen, and how many matches it has run.

Revision ID: 0007
Revises: 0006
"""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    op.add_column("worker", sa.Column("began_at", sa.Text))
    op.add_column("worker", sa.Column("seen_at", sa.Text))
    op.add_column("worker", sa.Column("ran", sa.BigInteger))
