"""Clips: short races behind slower cars, the same for everybody, measured and drawn."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.match import NO_TEAM, TESTED, Match, Race, Seat
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recorder import record_races
from nathlon.policies.load import load_policy
from nathlon.policies.policy import Policy
from nathlon.reports.race_data import race_data
from nathlon.sim.car import load_car
from nathlon.sim.clock import DYNAMICS_HZ
from nathlon.sim.errors import InputError
from nathlon.sim.instruments import QUANTITIES, Instruments, Transition
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from nathlon.sim.untrusted_file import read_text
from nathlon.sim.whole_file import whole_file, write_whole
from nathlon.sim.world import World

SCENARIO = str(Path(__file__).with_name("clip.toml"))
OTHERS = ("driver:pace=0.9", "driver:pace=0.86,lane=2.5", "driver:pace=0.88,lane=-2.5")
"""Who drive ahead, from the first place."""
FIRST_SEED = 7100
ARRAYS, DRAWN = "clips.npz", "clips.json"
LARGEST_MIB = 16


@dataclass(frozen=True)
class Clips:
    """What a policy did from each of the starts, in its car, the last of each race.

    Attributes:
        name: of whoever drove.
        readings: QUANTITIES by name, each (starts, steps) float64.
        driven: (starts, steps) bool, false once the car is out.
        poses: (starts, steps + 1, cars, 3) float64, x and y in m and yaw in rad of all cars.
        drawn: each race as the player reads it.
    """

    name: str
    readings: Mapping[str, NDArray[np.float64]]
    driven: NDArray[np.bool_]
    poses: NDArray[np.float64]
    drawn: Sequence[dict[str, Any]]

    def save(self, folder: Path) -> None:
        """Keep them in a folder, which is made."""
        folder.mkdir(parents=True, exist_ok=True)
        with whole_file(folder / ARRAYS) as partial, partial.open("wb") as file:
            np.savez_compressed(
                file,
                readings=np.stack([self.readings[name] for name in QUANTITIES]).astype(np.float32),
                driven=self.driven,
                poses=self.poses.astype(np.float32),
            )
        # Last: where it is, the arrays are too.
        write_whole(folder / DRAWN, json.dumps({"name": self.name, "races": self.drawn}))

    @classmethod
    def load(cls, folder: Path) -> Clips:
        """Those that a folder keeps.

        Raises:
            InputError: if they cannot be read.
        """
        path = folder / ARRAYS
        try:
            drawn = json.loads(read_text(folder / DRAWN, "clips", LARGEST_MIB))
            with np.load(path, allow_pickle=False) as arrays:
                readings, driven, poses = (arrays[name] for name in ("readings", "driven", "poses"))
            named = dict(zip(QUANTITIES, readings.astype(np.float64), strict=True))
            return cls(str(drawn["name"]), named, driven, poses.astype(np.float64), list(drawn["races"]))
        except (OSError, BadZipFile, ValueError, KeyError, TypeError):
            raise InputError(f"{path}: cannot be read, expected the clips of a reward's design") from None


def kept(folder: Path) -> bool:
    """Whether a folder keeps clips."""
    return (folder / DRAWN).exists()


class Studio:
    """Where clips are made.

    Attributes:
        circuit, car: what is driven.
        starts: how many clips a policy gets.
        step_s: length of a step, s.

    Args:
        circuit, car, starts: as above.
        first_seed: of the first start.
    """

    def __init__(self, circuit: str, car: str, starts: int, first_seed: int = FIRST_SEED) -> None:
        self.circuit, self.car, self.starts = circuit, car, starts
        self._first_seed = first_seed
        self._scenario = load_scenario(SCENARIO)
        self._own = self._scenario.cars - 1
        self.step_s = float(self._scenario.reaction.period[0] / DYNAMICS_HZ)
        self._instruments = Instruments(load_track(circuit), load_car(car), self.step_s)

    def film(self, policy: Policy, name: str) -> tuple[Clips, list[RaceLog]]:
        """Have a policy drive from all starts.

        Args:
            policy: drives the last car.
            name: by which it is shown.

        Returns:
            the clips, and the races as logs.
        """
        others = [Seat(entrant, NO_TEAM) for entrant in range(1, self._own + 1)]
        seats = (*others, Seat(0, TESTED))
        races = tuple(Race(self._first_seed + start, seats) for start in range(self.starts))
        names = (name, *OTHERS)
        match = Match("race", "clip", SCENARIO, self.circuit, self.car, names, names, races)
        drivers = [load_policy(source, self.circuit, self.car) for source in OTHERS]
        watch = _Watch(self._instruments, self._own)
        recorded = record_races(match, [policy, *drivers], range(self.starts), names, observer=watch)
        return watch.clips(name, [race_data(log) for log in recorded.logs]), recorded.logs


class _Watch:
    """Reads instruments after every step."""

    def __init__(self, instruments: Instruments, car: int) -> None:
        self._instruments, self._car = instruments, car
        self._before: NDArray[np.void] | None = None
        self._readings: list[NDArray[np.float64]] = []
        self._driven: list[NDArray[np.bool_]] = []
        self._poses: list[NDArray[np.float64]] = []

    def __call__(self, world: World) -> None:
        state = world.state
        if self._before is not None:
            races = np.flatnonzero(world.contact_count)
            contacts = [world.new_contacts(int(race)) for race in races]
            step = Transition(
                self._before,
                state,
                np.concatenate(contacts) if contacts else world.contacts[:0].reshape(-1),
                np.repeat(races, world.contact_count[races]),
            )
            read = self._instruments.read(QUANTITIES, step)
            self._readings.append(np.stack([read[name][:, self._car] for name in QUANTITIES]))
            self._driven.append(self._before["driving"][:, self._car].copy())
        self._before = state.copy()
        self._poses.append(np.stack([state["x"], state["y"], state["yaw"]], axis=-1))

    def clips(self, name: str, drawn: Sequence[dict[str, Any]]) -> Clips:
        """What it has seen."""
        readings = dict(zip(QUANTITIES, np.stack(self._readings, axis=-1), strict=True))
        driven = np.stack(self._driven, axis=-1)
        return Clips(name, readings, driven, np.stack(self._poses, axis=1), drawn)
