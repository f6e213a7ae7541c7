"""How much worse than the champion a candidate may be, and what finding it out may cost."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from nathlon.selection.bounds import MOST_PAIRS
from nathlon.sim.data_file import Section

Margin = Annotated[float, Field(gt=0, le=1e6)]
Risk = Annotated[float, Field(ge=0.001, le=0.4)]


class GateSettings(Section):
    """The section `gate` of the configuration.

    Attributes:
        points: team points a race by which a candidate may be worse; None does not ask, as in what follows.
        at_fault_per_km: contacts that the stewards lay to it, more a car and kilometre.
        breakdowns: share of the runs alone, time trials and tests without opponents, in which it must not
            break down: get stuck, complete no lap, or be at fault. So many have to be ruled out.
        lap: share of the champion's lap time by which its lap may be longer, where both complete one.
        tests: skill tests to pass as well: shipped names, or paths of `.toml` files.
        test_points: points of such a test, of which the baseline gets 500.
        action_ms: that the 99th percentile of the candidate's time for an action may be, on this machine.
        max_faults: runs that may end by the candidate's fault, in all.
        pairs: mirrored pairs of races against the champion, at most.
        runs: in the time trial and in each test, at most; 63 without a breakdown rule out 5 %, 321 rule out
            1 %.
        block: pairs and runs of a round; after each it is decided what is still open.
        alpha: probability to pass a candidate that is worse by a margin.
        beta: probability, in each measure, to fail one that is as good.
    """

    points: Margin | None = 2.0
    at_fault_per_km: Margin | None = 0.05
    breakdowns: Annotated[float, Field(ge=0.001, le=0.9)] | None = 0.05
    lap: Annotated[float, Field(gt=0, le=1)] | None = 0.005
    tests: tuple[str, ...] = ()
    test_points: Margin = 50.0
    action_ms: Annotated[float, Field(gt=0, le=1e6)] | None = None
    max_faults: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    pairs: Annotated[int, Field(ge=4, le=MOST_PAIRS)] = 96
    runs: Annotated[int, Field(ge=4, le=MOST_PAIRS)] = 192
    block: Annotated[int, Field(ge=4, le=MOST_PAIRS)] = 8
    alpha: Risk = 0.05
    beta: Risk = 0.05
