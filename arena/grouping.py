"""Which matches share a world: what a tick costs whatever their number is then paid once."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from itertools import pairwise

from nathlon.arena.match import Match
from nathlon.sim.scenario import load_scenario

CARS = 256
"""In a world: beyond it the work for each car is most of the work, and the networks of all their matches
leave the cache from tick to tick."""
CAR_SECONDS = 160_000.0
"""To simulate in a world at most: some ten seconds of work, which is lost when a run is killed."""
GROUPS_A_WORKER = 2
"""At least, if there are matches enough: workers that are done early take over from others."""

ROUNDING = 1e-9


def group(matches: Iterable[Match], workers: int) -> list[list[Match]]:
    """Matches of the same scenario, circuit and car in groups, those that take longest first.

    Args:
        matches: what to run.
        workers: processes that will share the groups.
    """
    alike: dict[tuple[str, str, str], list[Match]] = defaultdict(list)
    for match in matches:
        alike[match.scenario, match.circuit, match.car].append(match)
    seconds = {kind: sum(map(_car_seconds, those)) for kind, those in alike.items()}
    share = sum(seconds.values()) / (GROUPS_A_WORKER * workers)
    groups = []
    for kind, those in alike.items():
        scenario = load_scenario(kind[0])
        most = min(share, CAR_SECONDS, CARS * scenario.time_s)
        groups += _split(those, math.ceil(seconds[kind] / most - ROUNDING))
    return sorted(groups, key=lambda those: -sum(map(_car_seconds, those)))


def _car_seconds(match: Match) -> float:
    """Upper bound of what there is to simulate in a match."""
    scenario = load_scenario(match.scenario)
    return len(match.races) * scenario.cars * scenario.time_s


def _split(matches: list[Match], parts: int) -> list[list[Match]]:
    """Even parts in the order given, none of them empty."""
    parts = min(parts, len(matches))
    ends = [len(matches) * part // parts for part in range(parts + 1)]
    return [matches[begin:end] for begin, end in pairwise(ends)]
