"""A committee of four candidates with a question to decide, for the tests of the committee."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import polars as pl

from nathlon.arena.entrant import Entrant
from nathlon.arena.results import BATTERY
from nathlon.selection.committee import ask as put
from nathlon.selection.committee import vote
from nathlon.selection.committee.ballots import Ballot
from nathlon.selection.committee.decision import CommitteeDecision
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.committee.rules import CommitteeSettings
from tests.support.race_results import rows

NAMES = ("amber", "birch", "cedar", "delta")
POINTS = {"amber": 5000.0, "birch": 6000.0, "cedar": 4000.0, "delta": 3000.0}
RUN = "night"
ALONE = CommitteeSettings(shortlist=2)
PEOPLE = CommitteeSettings(members=("ann", "bob", "cy"), quorum=2, shortlist=2)


def entrant_id(name: str) -> str:
    return f"{name}-0123456789"


def ids(names: str) -> tuple[str, ...]:
    """Entrant ids of candidates by their initials."""
    return tuple(entrant_id(next(name for name in NAMES if name.startswith(letter))) for letter in names)


def entrants(names: Sequence[str] = NAMES) -> list[Entrant]:
    return [Entrant(entrant_id(n), n, f"{n}.safetensors", "x", "c", "k", None, None) for n in names]


def battery(names: Sequence[str] = NAMES) -> pl.DataFrame:
    points = [POINTS[name] for name in names]
    return pl.DataFrame(
        {
            "entrant": [entrant_id(name) for name in names],
            "points": points,
            "points_low": [p - 700 for p in points],
            "points_high": [p + 700 for p in points],
            "rank": [1] * len(names),
            "shortlisted": [False] * len(names),
        },
        schema=BATTERY,
    )


def results(**columns: Sequence[Any]) -> pl.DataFrame:
    """One race of 10 km in 300 s for each candidate, with these columns by candidate."""
    return rows({"entrant": [entrant_id(n) for n in NAMES], "race": range(4), **columns}, 4)


def ask(event_log: EventLog, settings: CommitteeSettings, **columns: Sequence[Any]) -> CommitteeDecision:
    return put(event_log, "shortlist", entrants(), {"battery": battery()}, results(**columns), settings)


def cast(event_log: EventLog, member: str, approve: str, rank: str = "") -> None:
    decision = event_log.decisions()["shortlist"]
    vote(event_log, decision, member, Ballot(ids(approve), ids(rank)), f"as {member} saw it")


def chosen(decision: CommitteeDecision) -> str:
    """Initials of those chosen, in their order."""
    assert decision.result is not None
    return "".join(entrant[0] for entrant in decision.result.chosen)
