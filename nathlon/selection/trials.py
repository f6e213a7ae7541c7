"""Matches of one entrant among the same opponents for all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nathlon.arena.entrant import Entrant
from nathlon.arena.match import BACKGROUND, TESTED, Match, Race, Seat
from nathlon.arena.world_registry import home
from nathlon.policies.sources.identity import policy_id


def against(
    stage: str,
    test: str,
    scenario: str,
    entrant: Entrant,
    opponents: Sequence[str],
    slots: Sequence[int],
    seeds: Sequence[int],
    in_order: bool = False,
    before: int = 0,
) -> Match:
    """One entrant among others, once for each seed, from the given slots in turn.

    A slot is a side of the scenario, of which the entrant takes all seats; the opponents take the other
    sides in turn, and the world's baseline the seats of no side. Which opponent comes first moves on from
    run to run unless they keep their order. Both go on from where `before` earlier runs have left them.

    Raises:
        InputError: if there is no such opponent.
    """
    world = home(entrant)
    setup = world.setup(scenario)
    places = len(setup.sides)
    sources = tuple(dict.fromkeys([*opponents, world.baseline] if setup.free else opponents))
    races = []
    for run, seed in enumerate(seeds, before):
        own = slots[run % len(slots)] - 1
        first = 0 if in_order else run
        others = iter(1 + sources.index(opponents[k % len(opponents)]) for k in range(first, first + places))
        seats = {seat: Seat(1 + sources.index(world.baseline), BACKGROUND) for seat in setup.free}
        for place, side in enumerate(setup.sides):
            taken = Seat(0, TESTED) if place == own else Seat(next(others))
            seats |= dict.fromkeys(side, taken)
        races.append(Race(seed, tuple(seats[seat] for seat in range(len(seats)))))
    return Match(
        stage,
        test,
        scenario,
        entrant.circuit,
        entrant.car,
        (entrant.id, *map(policy_id, sources)),
        (entrant.source, *sources),
        tuple(races),
        entrant.world,
    )


def draw_seeds(seeds: np.random.SeedSequence, count: int) -> list[int]:
    """Seeds of `count` races, which fit in a signed 64-bit integer."""
    return [int(seed >> np.uint64(1)) for seed in seeds.generate_state(count, np.uint64)]
