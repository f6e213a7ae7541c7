"""The first version: one run to a store.

Revision ID: 0001
"""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None

RESULT = {
    "match": sa.Text,
    "stage": sa.Text,
    "test": sa.Text,
    "race": sa.BigInteger,
    "seed": sa.BigInteger,
    "mirrored": sa.Boolean,
    "car": sa.BigInteger,
    "slot": sa.BigInteger,
    "entrant": sa.Text,
    "team": sa.BigInteger,
    "place": sa.BigInteger,
    "points": sa.Double,
    "laps": sa.BigInteger,
    "ending": sa.Text,
    "race_time_s": sa.Double,
    "driven_s": sa.Double,
    "distance_m": sa.Double,
    "best_lap_s": sa.Double,
    "off_course_s": sa.Double,
    "wall_s": sa.Double,
    "contacts": sa.BigInteger,
    "contacts_faster_behind": sa.BigInteger,
    "contacts_at_fault": sa.BigInteger,
    "penalties": sa.BigInteger,
}
STAGE_TABLES = {
    "entrants": {
        "entrant": sa.Text,
        "name": sa.Text,
        "source": sa.Text,
        "algorithm": sa.Text,
        "circuit": sa.Text,
        "car": sa.Text,
        "step": sa.BigInteger,
        "seed": sa.BigInteger,
    },
    "pareto": {
        "entrant": sa.Text,
        "lap_s": sa.Double,
        "off_course_share": sa.Double,
        "contacts_per_km": sa.Double,
        "nondominated_probability": sa.Double,
        "survives": sa.Boolean,
        "races": sa.BigInteger,
    },
    "skills": {
        "entrant": sa.Text,
        "test": sa.Text,
        "measure": sa.Double,
        "unit": sa.Text,
        "points": sa.Double,
        "points_low": sa.Double,
        "points_high": sa.Double,
        "runs": sa.BigInteger,
    },
    "battery": {
        "entrant": sa.Text,
        "points": sa.Double,
        "points_low": sa.Double,
        "points_high": sa.Double,
        "rank": sa.BigInteger,
        "shortlisted": sa.Boolean,
    },
    "ranking": {
        "entrant": sa.Text,
        "rank": sa.BigInteger,
        "points_per_race": sa.Double,
        "points_low": sa.Double,
        "points_high": sa.Double,
        "contacts_per_km": sa.Double,
        "contacts_low": sa.Double,
        "contacts_high": sa.Double,
        "pairs": sa.BigInteger,
        "races": sa.BigInteger,
        "faults": sa.BigInteger,
    },
    "matchups": {
        "entrant": sa.Text,
        "opponent": sa.Text,
        "pairs": sa.BigInteger,
        "points_per_race": sa.Double,
        "difference": sa.Double,
        "difference_low": sa.Double,
        "difference_high": sa.Double,
        "contacts_per_km": sa.Double,
    },
}


def upgrade() -> None:
    op.create_table(
        "match",
        sa.Column("key", sa.Text, primary_key=True),
        sa.Column("stage", sa.Text, nullable=False, index=True),
        sa.Column("spec", sa.Text, nullable=False),
    )
    op.create_table(
        "result",
        *(sa.Column(name, kind) for name, kind in RESULT.items()),
        sa.PrimaryKeyConstraint("match", "race", "car"),
        sa.ForeignKeyConstraint(["match"], ["match.key"]),
    )
    for name, columns in STAGE_TABLES.items():
        op.create_table(
            name,
            sa.Column("position", sa.BigInteger, primary_key=True, autoincrement=False),
            *(sa.Column(column, kind) for column, kind in columns.items()),
        )
    op.create_table(
        "fact",
        sa.Column("key", sa.Text, primary_key=True),
        sa.Column("value", sa.Text, nullable=False),
    )
