"""The matches that each stage of the selection needs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from arena.entrant import Entrant
from arena.match import Match, Race, Seat
from nathlon.skill import Skill
from sim.scenario import load_scenario
from tournament.schedule import MIRRORED_GRIDS, round_robin

FILTER_SCENARIO = "race"
FILTER_RACES = 4
FILTER_OPPONENTS = ("driver:pace=0.88", "driver:pace=0.93", "driver:pace=0.98")
TOURNAMENT_SCENARIO = "race"


def _against(
    stage: str,
    test: str,
    scenario: str,
    entrant: Entrant,
    opponents: Sequence[str],
    slots: Sequence[int],
    seeds: Sequence[int],
) -> Match:
    """One entrant among built-in drivers, once for each seed, from the given slots in turn."""
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
        (entrant.id, *drivers),
        (entrant.source, *drivers),
        tuple(races),
    )


def _draw(seeds: np.random.SeedSequence, count: int) -> list[int]:
    return [int(seed >> np.uint64(1)) for seed in seeds.generate_state(count, np.uint64)]


def filter_matches(entrants: Sequence[Entrant], seeds: np.random.SeedSequence) -> list[Match]:
    """A few races from the back of the grid against a common field, the same for every entrant."""
    drawn = _draw(seeds, FILTER_RACES)
    last = load_scenario(FILTER_SCENARIO).cars
    return [
        _against("pareto", FILTER_SCENARIO, FILTER_SCENARIO, entrant, FILTER_OPPONENTS, [last], drawn)
        for entrant in entrants
    ]


def skill_matches(
    entrants: Sequence[Entrant], skills: Sequence[Skill], seeds: np.random.SeedSequence
) -> list[tuple[Skill, Entrant, Match]]:
    """Every entrant through every skill test, with the same seeds for all."""
    matches = []
    for skill, stream in zip(skills, seeds.spawn(len(skills)), strict=True):
        drawn = _draw(stream, skill.runs)
        for entrant in entrants:
            match = _against(
                "battery", skill.name, skill.scenario, entrant, skill.opponents, skill.slots, drawn
            )
            matches.append((skill, entrant, match))
    return matches


def tournament_matches(entrants: Sequence[Entrant], pairs: int, seeds: np.random.SeedSequence) -> list[Match]:
    """A 4v4 round robin of mirrored pairs, one match a matchup."""
    by_id = {entrant.id: entrant for entrant in entrants}
    matches = []
    schedule = round_robin([entrant.id for entrant in entrants], pairs, seeds)
    for (first, second), meetings in groupby(schedule, lambda pairing: (pairing.entrant, pairing.opponent)):
        races = []
        for meeting in meetings:
            for grid in MIRRORED_GRIDS:
                seats = [Seat(int(slot in grid.slots[1]), int(slot in grid.slots[1])) for slot in range(1, 9)]
                races.append(Race(meeting.seed, tuple(seats), grid.mirrored))
        a, b = by_id[first], by_id[second]
        matches.append(
            Match(
                "tournament",
                TOURNAMENT_SCENARIO,
                TOURNAMENT_SCENARIO,
                a.circuit,
                a.car,
                (a.id, b.id),
                (a.source, b.source),
                tuple(races),
            )
        )
    return matches
