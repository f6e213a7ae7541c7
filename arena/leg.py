"""Legs: a long race is driven a part at a time, so that it can be stopped and goes on later, to the bit.

Each leg begins with policies that are loaded anew and the state that the leg before it left, whether or not
anybody stopped in between.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import polars as pl

from nathlon.arena.halt import Halt
from nathlon.arena.lap_chart import LapChart
from nathlon.arena.match import Match
from nathlon.arena.runner import run_until
from nathlon.arena.team import Absent
from nathlon.arena.watch import Watch
from nathlon.policies.policy import Policy


class Leg(NamedTuple):
    """A part of a match with one race.

    Attributes:
        number: of the leg, from 0.
        until_s: when it ends, s since the start, unless the race is over before; whole seconds.
        begin: as the leg before it left it; None for the start.
    """

    number: int
    until_s: float
    begin: Halt | None = None


class LegDriven(NamedTuple):
    """What a leg came to.

    Attributes:
        halt: in which it left the race.
        laps: that were completed in it, schema LAP_CHART.
        results: schema RESULTS; None while the race is not over.
    """

    halt: Halt
    laps: pl.DataFrame
    results: pl.DataFrame | None


def drive_leg(match: Match, policies: Sequence[Policy | Absent], leg: Leg, watch: Watch) -> LegDriven:
    """Drive a leg with a policy for each of the match's entrants."""
    chart = LapChart()
    halt, results = run_until(match, policies, watch, leg.until_s, leg.number, leg.begin, chart)
    return LegDriven(halt, chart.frame, results)
