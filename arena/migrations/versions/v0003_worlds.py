"""Results of other worlds: a score, and measures of their own.

Revision ID: 0003
Revises: 0002
"""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    op.add_column("result", sa.Column("score", sa.Double))
    op.add_column("result", sa.Column("measures", sa.Text))
