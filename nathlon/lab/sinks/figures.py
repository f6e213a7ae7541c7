"""The numbers of a night by name, as trackers take them."""

from __future__ import annotations

from nathlon.lab.sinks.bulletin import Bulletin

ENTRANT = ("points_per_race", "points_low", "points_high", "contacts_per_km", "at_fault_per_km")
"""What is said of one entrant."""
COLUMNS = ("rank", "worst_rank", "name", "entrant", *ENTRANT, "barred", "pairs", "races")
"""Of the ranking, in tables."""


def figures(bulletin: Bulletin) -> dict[str, float]:
    """What makes a curve over the nights: of whom a night sends, or else of the first in its ranking."""
    told = {"entrants": float(len(bulletin.ranking)), "code": float(bulletin.code)}
    sent = {one.entrant for one in bulletin.sent}
    rows = sorted(bulletin.ranking, key=lambda row: row.entrant not in sent)
    for row in rows[:1]:
        told |= {name: value for name in ENTRANT if (value := getattr(row, name)) is not None}
    return told
