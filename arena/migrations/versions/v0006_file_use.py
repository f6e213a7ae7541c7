"""When a file was last put or asked for, so that what nobody needs any more can go.

Revision ID: 0006
Revises: 0005
"""

import sqlalchemy as sa
from alembic import op

from nathlon.arena.store.database import clock, stamp

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    op.add_column("file", sa.Column("used_at", sa.Text))
    now = stamp(clock(op.get_bind()))
    op.execute(sa.text("UPDATE file SET used_at = :now").bindparams(now=now))
