"""Which matches share a world: what a tick costs whatever their number is then paid once."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from itertools import accumulate

from nathlon.arena.match import Match
from nathlon.arena.world import Setup
from nathlon.arena.world_registry import load_world

CARS = 256
"""In a world: beyond it the work for each car is most of the work."""
MATCHES = 64
"""In a world: beyond it their networks fill memory, and leave the cache from tick to tick."""
CAR_SECONDS = 160_000.0
"""To simulate in a world at most: some ten seconds of work, which is lost when a run is killed."""
GROUPS_A_WORKER = 2
"""Workers that are done early take over from others."""

ROUNDING = 1e-9


def group(matches: Iterable[Match], workers: int, rounds: int = GROUPS_A_WORKER) -> list[list[Match]]:
    """Matches of the same scenario of the same world in groups, those that take longest first.

    Args:
        matches: what to run.
        workers: processes that will share the groups.
        rounds: groups for each of them, at least, if there are matches enough.
    """
    alike: dict[tuple[str | tuple[str, ...], ...], list[Match]] = defaultdict(list)
    for match in matches:
        alike[match.world, match.circuit, match.cars, match.scenario].append(match)
    seconds = {kind: sum(map(_car_seconds, those)) for kind, those in alike.items()}
    share = sum(seconds.values()) / (rounds * workers)
    groups = []
    for kind, those in alike.items():
        most = min(share, CAR_SECONDS, CARS * _setup(those[0]).time_s)
        groups += _split(those, math.ceil(max(seconds[kind] / most, len(those) / MATCHES) - ROUNDING))
    return sorted(groups, key=lambda those: -sum(map(_car_seconds, those)))


def fill(match: Match) -> int:
    """How many matches like this one fill a world."""
    return max(1, min(MATCHES, int(min(CAR_SECONDS, CARS * _setup(match).time_s) / _car_seconds(match))))


def longest_first(matches: Iterable[Match]) -> list[Match]:
    """Matches in the order in which they should begin, those of the same scenario side by side."""
    return [match for those in group(matches, 1) for match in those]


def _car_seconds(match: Match) -> float:
    """Upper bound of what there is to simulate in a match."""
    setup = _setup(match)
    return len(match.races) * len(setup.seats) * setup.time_s


def _setup(match: Match) -> Setup:
    return load_world(match.world, match.circuit, match.car).setup(match.scenario)


def _split(matches: list[Match], parts: int) -> list[list[Match]]:
    """Parts in the order given that take about as long, none of them empty."""
    seconds = [_car_seconds(match) for match in matches]
    total = sum(seconds)
    groups = defaultdict[int, list[Match]](list)
    for match, own, until in zip(matches, seconds, accumulate(seconds), strict=True):
        groups[int((until - 0.5 * own) / total * parts)].append(match)
    return list(groups.values())
