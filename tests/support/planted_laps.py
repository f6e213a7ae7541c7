"""A world without physics in which policies lap alone: how often they break down is known.

A policy is a file whose name says how: `old` never breaks down, `fragile-20` does in 20 % of its runs, drawn
by its name and the run's seed, and `illegal-20` ends as many by an illegal action. All lap in 100 s, within
half a second, and score 1 s less as a point more; who breaks down scores nothing like it.
"""

from __future__ import annotations

import zlib
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


class PlantedLaps:
    """One seat, one scenario."""

    name = ""
    scenarios = ("solo",)
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
        return Entrant(policy_id(source), Path(source).stem, source, "planted", "", "", None, None, self.name)

    def policy(self, source: str) -> str:
        """Its name is all there is to it."""
        return source

    def run(self, line_ups: Mapping[int, LineUp], watch: Watch) -> Iterator[tuple[int, pl.DataFrame]]:
        """Draw laps."""
        for number, (match, _) in line_ups.items():
            name = Path(match.sources[0]).stem
            rate = int(name.rpartition("-")[2]) / 100 if "-" in name else 0.0
            rows = []
            for index, race in enumerate(match.races):
                rng = np.random.default_rng([race.seed, zlib.crc32(name.encode())])
                breaks, lap = rng.uniform() < rate, 100.0 + rng.normal(0.0, 0.5)
                score = -200.0 if breaks else 100.0 - lap
                facts = match.seat_facts(index, 0) | {"place": 1, "points": score, "score": score}
                fault = "illegal_action" if name.startswith("illegal") else "stuck"
                ended = {"ending": fault} if breaks else {"ending": "finished", "best_lap_s": lap}
                rows.append(facts | ended)
            yield number, pl.DataFrame(rows, schema=RESULTS)


PLANTED = PlantedLaps()
