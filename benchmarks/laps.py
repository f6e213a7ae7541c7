"""A world that costs nothing: policies lap in the time that their files say.

In a module of its own, as every process that plays loads it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from nathlon.arena.entrant import Entrant
from nathlon.arena.results import RESULTS
from nathlon.arena.watch import Watch
from nathlon.arena.world import LineUp, Measure, Setup
from nathlon.policies.sources.identity import policy_id

NAME = "benchmarks.laps:world"
SLOWEST_S = 100.0


class Laps:
    """A world of one seat, in which a policy laps in the time that its file has, within half a second."""

    name = NAME
    scenarios = ("lap",)
    measures: Mapping[str, Measure] = {}
    baseline = "random"

    def setup(self, scenario: str) -> Setup:
        """A seat by itself."""
        return Setup(("driver",), ((0,),))

    def check(self, scenario: str) -> None:
        """It can be driven."""

    def facts(self, scenario: str) -> dict[str, Any]:
        """Nothing else decides."""
        return {"scenario": scenario}

    def enter(self, source: str) -> Entrant:
        """Any file is a policy."""
        name = Path(source).stem
        return Entrant(policy_id(source), name, source, "made up", "", "", None, None, NAME)

    def policy(self, source: str) -> float:
        """Its lap, s."""
        return SLOWEST_S if source == self.baseline else float(Path(source).read_text())

    def run(self, line_ups: Mapping[int, LineUp], watch: Watch) -> Iterator[tuple[int, pl.DataFrame]]:
        """Draw laps."""
        for number, (match, policies) in line_ups.items():
            rows = []
            pace: Any = policies[0]
            for index, race in enumerate(match.races):
                lap = pace + np.random.default_rng(race.seed).normal(0.0, 0.5)
                told = {"place": 1, "points": -lap, "score": -lap, "ending": "finished", "best_lap_s": lap}
                rows.append(match.seat_facts(index, 0) | told)
            yield number, pl.DataFrame(rows, schema=RESULTS)


world = Laps()
