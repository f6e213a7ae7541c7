"""A world without physics whose cells have known truths: what a matrix finds can be told from chance.

In a fifth of the cells the policy `new` is worse than `old`; in half of the others it is exactly as much
worse as the margins allow, in the rest as good. The two are files of these names.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from nathlon.arena.entrant import Entrant
from nathlon.arena.results import RESULTS
from nathlon.arena.watch import Watch
from nathlon.arena.world import LineUp, Measure, Setup
from nathlon.policies.sources.identity import policy_id
from nathlon.sim.errors import InputError

SCENARIOS, SEATS = 125, 8
MARGINS = {"score": 0.3, "own.slips": 0.2}
"""Of scores with a standard deviation of 1, and of counts with a mean of 0.1."""
SLIPS = 0.1
LARGEST = {"score": 3.0, "own.slips": 1.5}
"""By which `new` is worse at most, beyond the margin."""


class Truth(NamedTuple):
    """By how much `new` is worse in a cell, by measure."""

    score: float
    slips: float

    @property
    def worse(self) -> dict[str, bool]:
        """Whether it is by more than the margin."""
        return {
            "score": self.score > MARGINS["score"] + 1e-9,
            "own.slips": self.slips > MARGINS["own.slips"] + 1e-9,
        }


def truth(scenario: str, place: int) -> Truth:
    """The truth of a cell."""
    rng = np.random.default_rng([zlib.crc32(scenario.encode()), place])
    effects = []
    for name, margin in MARGINS.items():
        kind, beyond = rng.uniform(size=2)
        if kind < 0.2:
            effects.append(margin + beyond * LARGEST[name])
        else:
            effects.append(margin if kind < 0.6 else 0.0)
    return Truth(*effects)


class PlantedCells:
    """Scores are normal, slips Poisson; how good a seat is depends on nobody but who sits in it."""

    name = ""
    scenarios = tuple(f"s{number:03d}" for number in range(SCENARIOS))
    measures: Mapping[str, Measure] = {"slips": Measure("slips", "min")}
    baseline = "random"

    def setup(self, scenario: str) -> Setup:
        """Eight seats, each a side."""
        if scenario not in self.scenarios:
            raise InputError(f"scenario {scenario!r} is unknown, expected s000 and so on")
        seats = range(SEATS)
        return Setup(tuple(f"seat {seat}" for seat in seats), tuple((seat,) for seat in seats))

    def check(self, scenario: str) -> None:
        """All can be played."""

    def facts(self, scenario: str) -> dict[str, Any]:
        """Nothing but the scenario decides."""
        return {"scenario": scenario, "margins": MARGINS, "largest": LARGEST}

    def enter(self, source: str) -> Entrant:
        """`old` or `new`."""
        name = Path(source).stem
        if name not in ("old", "new", "random"):
            raise InputError(f"{source}: is no policy, expected old or new")
        return Entrant(policy_id(source), name, source, "planted", "", "", None, None, self.name)

    def policy(self, source: str) -> str:
        """Its name is all there is to it."""
        return source

    def run(self, line_ups: Mapping[int, LineUp], watch: Watch) -> Iterator[tuple[int, pl.DataFrame]]:
        """Draw scores and slips."""
        for number, (match, _) in line_ups.items():
            rows: list[dict[str, Any]] = []
            for index, race in enumerate(match.races):
                rng = np.random.default_rng(race.seed)
                scores, dice = rng.standard_normal(SEATS), rng.spawn(SEATS)
                here = []
                for car, seat in enumerate(race.seats):
                    own = truth(match.scenario, car + 1)
                    is_new = Path(match.sources[seat.entrant]).stem == "new"
                    own_rng = np.random.default_rng(dice[car].integers(2**62) + is_new)
                    score = scores[car] + own_rng.standard_normal() - is_new * own.score
                    slips = int(own_rng.poisson(SLIPS + is_new * own.slips))
                    here.append((float(score), slips))
                places = 1 + np.argsort(np.argsort([-score for score, _ in here]))
                for car, (score, slips) in enumerate(here):
                    facts = match.seat_facts(index, car)
                    facts |= {
                        "place": int(places[car]),
                        "points": score,
                        "score": score,
                        "ending": "finished",
                    }
                    rows.append(facts | {"measures": f'{{"slips": {slips}}}'})
            yield number, pl.DataFrame(rows, schema=RESULTS)


PLANTED = PlantedCells()
