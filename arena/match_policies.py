"""The policies of a match, as its sources give them now."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from nathlon.arena.match import Match
from nathlon.arena.world_registry import load_world
from nathlon.sim.errors import InputError


@lru_cache(maxsize=256)
def _policy(source: str, identity: str, world: str, circuit: str, car: str) -> Any:
    home = load_world(world, circuit, car)
    found = home.enter(source).id
    if found != identity:
        raise InputError(
            f"{source}: has changed since it was entered: its id is {found}, expected {identity}"
        )
    return home.policy(source)


def match_policies(match: Match) -> list[Any]:
    """The policies of a match, in the order of its entrants.

    Raises:
        InputError: if one cannot be loaded, or is another one by now.
    """
    return [match_policy(match, entrant) for entrant in range(len(match.entrants))]


def match_policy(match: Match, entrant: int) -> Any:
    """The policy of one of its entrants; see `match_policies`."""
    car = match.car_of(entrant)
    return _policy(match.sources[entrant], match.entrants[entrant], match.world, match.circuit, car)
