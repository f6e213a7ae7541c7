"""Matches of one entrant among the same opponents for all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nathlon.arena.entrant import Entrant
from nathlon.arena.match import Match, Race, Seat
from nathlon.policies.sources.identity import policy_id
from nathlon.sim.scenario import load_scenario


def against(
    stage: str,
    test: str,
    scenario: str,
    entrant: Entrant,
    opponents: Sequence[str],
    slots: Sequence[int],
    seeds: Sequence[int],
) -> Match:
    """One entrant among others, once for each seed, from the given slots in turn.

    Raises:
        InputError: if there is no such opponent.
    """
    drivers = tuple(dict.fromkeys(opponents))
    cars = load_scenario(scenario).cars
    races = []
    for run, seed in enumerate(seeds):
        own = slots[run % len(slots)] - 1
        others = iter(1 + drivers.index(opponents[k % len(opponents)]) for k in range(run, run + cars))
        races.append(Race(seed, tuple(Seat(0 if slot == own else next(others)) for slot in range(cars))))
    return Match(
        stage,
        test,
        scenario,
        entrant.circuit,
        entrant.car,
        (entrant.id, *map(policy_id, drivers)),
        (entrant.source, *drivers),
        tuple(races),
    )


def draw_seeds(seeds: np.random.SeedSequence, count: int) -> list[int]:
    """Seeds of `count` races, which fit in a signed 64-bit integer."""
    return [int(seed >> np.uint64(1)) for seed in seeds.generate_state(count, np.uint64)]
