"""Whether a world's episodes repeat: the same seed and seats give the same, whenever and wherever."""

from __future__ import annotations

import sys
import zlib
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.watch import Watch
from nathlon.arena.world import Setup, World
from nathlon.arena.world_registry import load_world
from nathlon.arena.worlds.episodes import EpisodeWorld
from nathlon.policies.hosting.child import Child, ChildError, RaisedError
from nathlon.policies.policy import Batch
from nathlon.policies.sources import RANDOM
from nathlon.sim.errors import InputError
from nathlon.sim.process import command_of

SEEDS = (1, 2, 1, 3)
"""Of episodes, in turn: others are played before one comes again."""
ELSEWHERE = (2, 1)
"""Of those in another process, in another order."""
REPEATING_S = 60.0
"""What the episodes may take, about."""
FEWEST, MOST = 3, 60
"""Of them at least and at most."""
HASH_SEEDS = ("1", "2")
"""Of Python's hashes of text in the other process: one that is not this process's own."""

Row = dict[str, Any]


class Witness:
    """A policy that goes by all that it has seen: once an observation differs, so does all that follows.

    Attributes:
        seen: a number for all that was seen up to each time that it was asked.
        precise: as of `nathlon.policies.general.policy.GeneralPolicy`.
    """

    precise = False

    def __init__(self) -> None:
        self.seen: list[int] = []

    def initial_memory(self, n: int) -> Batch:
        """No memory: (n, 0) float32."""
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[NDArray[Any], Batch]:
        """The last of `seen`, (1, 1)."""
        self.seen.append(zlib.crc32(observations.tobytes(), self.seen[-1] if self.seen else 0))
        return np.array([self.seen[-1:]]), memory

    def decode(self, row: NDArray[Any], space: Any, rng: np.random.Generator, mask: Any = None) -> Any:
        """An action drawn by this number."""
        own = copy(space)
        own.seed(int(row[0]))
        return own.sample()


@dataclass(frozen=True)
class Played:
    """An episode.

    Attributes:
        seed: its.
        rows: its RESULTS, without the match's key.
        seen: of each seat, as of `Witness`; empty where policies of other kinds play.
    """

    seed: int
    rows: list[Row]
    seen: list[list[int]] = field(default_factory=list)


def any_policy(world: World) -> Any:
    """One that can sit anywhere."""
    try:
        return world.policy(RANDOM)
    except InputError:
        return world.policy(world.baseline)


def play(world: World, scenario: str, setup: Setup, seed: int) -> Played:
    """Play an episode with a witness in every seat; in a world of another kind with a random policy."""
    seats = tuple(Seat(seat) for seat in range(len(setup.seats)))
    sources = (RANDOM,) * len(seats)
    match = Match("check", scenario, scenario, "", "", sources, sources, (Race(seed, seats),), world.name)
    witnesses = [Witness() for _ in seats] if isinstance(world, EpisodeWorld) else []
    [(_, rows)] = world.run({0: (match, witnesses or [any_policy(world)] * len(seats))}, Watch())
    return Played(seed, rows.drop("match").to_dicts(), [witness.seen for witness in witnesses])


def repeated(world: World, scenario: str, setup: Setup, episode_s: float) -> tuple[list[Played], str]:
    """Play seeds again and again.

    Args:
        world, scenario, setup: what is played.
        episode_s: what an episode takes, s.

    Returns:
        the episodes, up to one that does not repeat; what does not, in a sentence without its end, or ''.
    """
    first: dict[int, Played] = {}
    played: list[Played] = []
    for number in range(int(np.clip(REPEATING_S / max(episode_s, 1e-6), FEWEST, MOST))):
        episode = play(world, scenario, setup, SEEDS[number % len(SEEDS)])
        played.append(episode)
        said = differs(setup, first.setdefault(episode.seed, episode), episode)
        if said:
            return played, f"{said} when seed {episode.seed} is played again as episode {number + 1}"
    return played, ""


def differs(setup: Setup, one: Played, other: Played) -> str:
    """Where two episodes part first: seat and what it is, with both values; '' where they are the same."""
    steps = [
        (next((step for step, (a, b) in enumerate(zip(*both, strict=False)) if a != b), None), seat)
        for seat, both in enumerate(zip(one.seen, other.seen, strict=True))
    ]
    parted = min(((step, seat) for step, seat in steps if step is not None), default=None)
    if parted is not None:
        return f"seat {setup.seats[parted[1]]!r}: observation {parted[0] + 1} is another one"
    for own, again in zip(one.rows, other.rows, strict=True):
        for column, value in own.items():
            if value != again[column]:
                said = f"{column} is {value}, and {again[column]}"
                return f"seat {setup.seats[own['car']]!r}: {said}"
    for seat, (own_seen, seen) in enumerate(zip(one.seen, other.seen, strict=True)):
        if len(own_seen) != len(seen):
            return f"seat {setup.seats[seat]!r}: has {len(own_seen)} steps, and {len(seen)}"
    return ""


def starts(played: Sequence[Played]) -> str:
    """What is to be said of different seeds that do alike, in a sentence, or ''."""
    by_seed = {episode.seed: episode for episode in played if any(episode.seen)}
    if len(by_seed) < 2:
        return ""
    if len({str(episode.seen) for episode in by_seed.values()}) == 1:
        return (
            f"Different seeds ({len(by_seed)} tried) give the same episode: the same policies will play it "
            "again and again, and intervals of width zero mean nothing. Draw the start from the seed."
        )
    if len({str([seen[:1] for seen in episode.seen]) for episode in by_seed.values()}) == 1:
        return (
            f"Different seeds ({len(by_seed)} tried) start alike: only later does the seed make a difference."
        )
    return ""


class Elsewhere:
    """A process of another hash seed, in which a world is made anew; see `nathlon.arena.worlds.repeats_host`.

    It starts when it is first needed.
    """

    def __init__(self, world: str, own_hash_seed: str, limit_s: float) -> None:
        """Of a world.

        Args:
            world: its name.
            own_hash_seed: PYTHONHASHSEED where the other episodes are played.
            limit_s: what an answer may take.
        """
        self._hash_seed = next(one for one in HASH_SEEDS if one != own_hash_seed)
        self._world, self._limit_s = world, limit_s
        self._child: Child | None = None

    def play(self, scenario: str) -> list[Played] | str:
        """The episodes of the seeds `ELSEWHERE`, or why there are none."""
        if self._child is None:
            command = command_of("nathlon.arena.worlds.repeats_host", "{pipe}")
            self._child = Child(command, {"PYTHONHASHSEED": self._hash_seed})
        wanted = {"path": sys.path, "world": self._world, "scenario": scenario}
        try:
            told, _ = self._child.ask(wanted, limit_s=self._limit_s)
        except ChildError as error:
            self._child = None
            return str(error)
        except RaisedError as error:
            return str(error)
        return [Played(**episode) for episode in told["played"]]

    def close(self) -> None:
        """End it."""
        if self._child is not None:
            self._child.end()


def play_here(name: str, scenario: str) -> list[Played]:
    """The episodes of the seeds `ELSEWHERE` in this process."""
    world = load_world(name)
    setup = world.setup(scenario)
    return [play(world, scenario, setup, seed) for seed in ELSEWHERE]
