"""How much sooner matches are played whose simulator steps many episodes at once.

The toy is a chain of pendulums, integrated in small steps by numpy: an episode alone costs about as much as
a whole batch, as in simulators on JAX or a GPU. The same matches are played in `VectorWorld` with a batch of
one and with one of `SIZE`.

    python -m benchmarks.vector_world --json FILE
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from benchmarks.result import write_result
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.watch import Watch
from nathlon.arena.worlds.vector import VectorWorld
from nathlon.policies.general import load_general

SIZE, MATCHES, RACES, STEPS = 64, 8, 8, 40
LINKS, SMALL_STEPS, DT = 6, 200, 0.0005


class Chains:
    """Hanging chains of which the first link is turned; a point for every step that their ends stay low."""

    single_observation_space = Box(-np.inf, np.inf, (2 * LINKS,))
    single_action_space = Box(-1.0, 1.0, (1,))

    def __init__(self, n: int) -> None:
        self._n = n

    def reset(self, seed: Sequence[int]) -> Any:
        """As of VectorEnv; so is the following."""
        self._angles = np.stack([np.random.default_rng(one).normal(0.0, 0.3, LINKS) for one in seed])
        self._rates, self._steps = np.zeros((self._n, LINKS)), 0
        return self._seen(), {}

    def step(self, actions: NDArray[Any]) -> Any:
        for _ in range(SMALL_STEPS):
            pull = np.diff(self._angles, axis=1, prepend=0.0, append=self._angles[:, -1:])
            self._rates += DT * (pull[:, 1:] - pull[:, :-1] - np.sin(self._angles) - 0.1 * self._rates)
            self._rates[:, 0] += DT * actions[:, 0]
            self._angles += DT * self._rates
        self._steps += 1
        over = np.full(self._n, self._steps == STEPS)
        low = (np.abs(self._angles[:, -1]) < 0.2).astype(float)
        return self._seen(), low, over, np.zeros(self._n, bool), {}

    def _seen(self) -> NDArray[np.float32]:
        return np.concatenate([self._angles, self._rates], axis=1).astype(np.float32)


def chains(size: int) -> VectorWorld:
    """The world with batches of a size."""
    world = VectorWorld({"chains": Chains}, size=size, most_steps=STEPS)
    world.name = f"benchmarks.vector_world:of_{size}"
    return world


of_1, of_64 = chains(1), chains(SIZE)


def played(world: Any) -> tuple[float, list[float]]:
    """Processor time of all matches, s, and all scores."""
    policy = load_general("random", *world.spaces("chains")[0])
    line_ups: dict[int, Any] = {}
    for number in range(MATCHES):
        races = tuple(Race(RACES * number + race, (Seat(0),)) for race in range(RACES))
        match = Match("t", "chains", "chains", "", "", (str(number),), ("random",), races, world.name)
        line_ups[number] = match, [policy]
    began = time.process_time()
    rows = dict(world.run(line_ups, Watch()))
    took_s = time.process_time() - began
    return took_s, [score for number in line_ups for score in rows[number]["score"]]


def main() -> None:
    """Print and write the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.vector_world", description=__doc__)
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args()
    (alone_s, alone), (together_s, together) = played(of_1), played(of_64)
    figures = {
        "episodes": MATCHES * RACES,
        "steps": STEPS,
        "size": SIZE,
        "alone_cpu_s": round(alone_s, 2),
        "together_cpu_s": round(together_s, 2),
        "times_as_fast": round(alone_s / together_s, 1),
        "same_scores": alone == together,
    }
    if options.json:
        write_result(options.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
