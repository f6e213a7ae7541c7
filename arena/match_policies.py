"""The policies of a match, as its sources give them now."""

from __future__ import annotations

from functools import lru_cache

from nathlon.arena.entrant import enter
from nathlon.arena.match import Match
from nathlon.policies.load import load_policy
from nathlon.policies.policy import Policy
from nathlon.sim.errors import InputError


@lru_cache(maxsize=256)
def _policy(source: str, identity: str, circuit: str, car: str) -> Policy:
    found = enter(source, circuit, car).id
    if found != identity:
        raise InputError(
            f"{source}: has changed since it was entered: its id is {found}, expected {identity}"
        )
    return load_policy(source, circuit, car)


def match_policies(match: Match) -> list[Policy]:
    """The policies of a match, in the order of its entrants.

    Raises:
        InputError: if one cannot be loaded, or is another one by now.
    """
    return [match_policy(match, entrant) for entrant in range(len(match.entrants))]


def match_policy(match: Match, entrant: int) -> Policy:
    """The policy of one of its entrants; see `match_policies`."""
    return _policy(match.sources[entrant], match.entrants[entrant], match.circuit, match.car)
