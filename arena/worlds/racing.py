"""Our own simulator as a world: one circuit, one car, and perhaps a loader of others' files."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from importlib import metadata
from typing import Any

import numpy as np
import polars as pl

from nathlon.arena.entrant import Entrant, enter
from nathlon.arena.naming import stem
from nathlon.arena.runner import run_together
from nathlon.arena.watch import Watch
from nathlon.arena.world import LineUp, Loader, Measure, Setup
from nathlon.arena.world_finding import RACING, with_loader
from nathlon.arena.worlds.loaded import loader_of
from nathlon.arena.worlds.loaded_racer import load_racer
from nathlon.arena.worlds.named_loader import named_loader
from nathlon.policies.load import load_policy
from nathlon.policies.policy import Policy
from nathlon.policies.sources import DRIVER, is_path
from nathlon.policies.sources.identity import policy_id
from nathlon.sim.car import load_car
from nathlon.sim.decisive import EPISODES, fingerprint
from nathlon.sim.names import proper_name
from nathlon.sim.rules import load_rules
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track


class Racing:
    """Races on a circuit; every starting place is a side."""

    name = RACING
    scenarios: tuple[str, ...] = ("sprint",)
    measures: Mapping[str, Measure] = {}
    baseline = DRIVER
    episode = "race"
    circuits = True
    loaders: Mapping[str, Loader] = {}

    def __init__(self, circuit: str, car: str, loader: str = "") -> None:
        """Of a circuit and a car, and of the loader of a name if it is not empty.

        Raises:
            InputError: if there is no such loader.
        """
        self._circuit, self._car = circuit, car
        self._loader = named_loader(loader) if loader else None
        if self._loader is not None:
            self.name, self.loaders = with_loader(RACING, loader), self._loader.by_ending

    def setup(self, scenario: str) -> Setup:
        """A scenario by its shipped name or the path of its file."""
        loaded = load_scenario(scenario)
        places = range(loaded.cars)
        return Setup(
            tuple(f"place {place + 1}" for place in places),
            tuple((place,) for place in places),
            "place",
            loaded.time_s,
            loaded.laps is not None or loaded.finish_m is not None,
        )

    def check(self, scenario: str) -> None:
        """As of `nathlon.arena.world.World`: whether the circuit has room for its places."""
        load_scenario(scenario).place(load_track(self._circuit), np.random.default_rng(0))

    def facts(self, scenario: str) -> dict[str, Any]:
        """As of `nathlon.arena.world.World`."""
        facts = surroundings(scenario, self._circuit, self._car) | {
            "code": fingerprint(),
            "numpy": _version("numpy"),
            "numba": _version("numba"),
            "onnxruntime": _version("onnxruntime"),
            "scipy": _version("scipy"),
        }
        if self._loader is not None:
            facts["loader"] = self._loader.identity | {"code": fingerprint(names=EPISODES)}
        return facts

    def enter(self, source: str) -> Entrant:
        """As of `nathlon.arena.world.World`."""
        if self._load(source) is None:
            return replace(enter(source, self._circuit, self._car), world=self.name)
        self.policy(source)
        identity, name = policy_id(source), proper_name(stem(source))
        return Entrant(identity, name, source, "unknown", self._circuit, self._car, None, None, self.name)

    def policy(self, source: str) -> Policy:
        """As of `nathlon.arena.world.World`."""
        load = self._load(source)
        if load is None:
            return load_policy(source, self._circuit, self._car)
        return load_racer(source, load)

    def _load(self, source: str) -> Loader | None:
        return loader_of(self.loaders, source) if is_path(source) else None

    def run(self, line_ups: Mapping[int, LineUp], watch: Watch) -> Iterator[tuple[int, pl.DataFrame]]:
        """As of `nathlon.arena.world.World`: all races in one world, a matrix a policy and tick."""
        return run_together(line_ups, watch)


@cache
def _version(package: str) -> str:
    """Of an installed package; to look it up takes longer than all the rest that decides a match."""
    return metadata.version(package)


def surroundings(scenario: str, circuit: str, car: str) -> dict[str, Any]:
    """What the files of a scenario, a circuit and a car say, as plain JSON values.

    Raises:
        InputError: if one is unknown or its file is wrong.
    """
    track = load_track(circuit)
    return {
        "scenario_file": load_scenario(scenario).model_dump(),
        "rules_file": load_rules(load_scenario(scenario).rules).model_dump(),
        "car_file": load_car(car).model_dump(),
        "track": hashlib.sha256(track.table.tobytes()).hexdigest(),
        "along": {
            "grid": track.grid.model_dump(),
            "sectors": list(track.sectors),
            "sections": [section.model_dump() for section in track.sections],
            "pit_lane": track.pit_lane.model_dump(),
        },
    }
