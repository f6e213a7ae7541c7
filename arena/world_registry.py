"""Worlds by name, as what they offer."""

from __future__ import annotations

from typing import Protocol

from nathlon.arena.world import World
from nathlon.arena.world_finding import find_world


def load_world(name: str, circuit: str = "", car: str = "") -> World:
    """The world of a name, see `nathlon.arena.world_finding.find_world`.

    Raises:
        InputError: if there is no such world, or it cannot be loaded.
    """
    world: World = find_world(name, circuit, car)
    return world


class AtHome(Protocol):
    """A match or an entrant: what says where it plays."""

    @property
    def world(self) -> str: ...
    @property
    def circuit(self) -> str: ...
    @property
    def car(self) -> str: ...


def home(one: AtHome) -> World:
    """The world of a match or an entrant; see `load_world`."""
    return load_world(one.world, one.circuit, one.car)
