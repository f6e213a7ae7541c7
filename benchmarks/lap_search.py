"""How fast a lap ten actions a second allow: a random search around a checkpoint's policy.

Run as `python -m benchmarks.lap_search [--json FILE] CHECKPOINT ...`; the last line of the output is one JSON
object: by the name of the checkpoint's file

- `circuit`, `car`: where, and in what;
- `limit_s`: the fastest lap by optimal control, null if it is not known;
- `policy_s`, `searched_s`: a flying lap of the policy, and one of the search;
- `off_course_s`: of the searched lap.

The limit acts at every moment and changes gear at once. This says how much of it is in reach of actions that
hold for 0.1 s, and so how much of what a policy loses against it could still be learnt. The search knows the
future: every 0.2 s it tries changes to the policy's actions of the next 2 s in the simulator itself, lets the
policy go on for 3 s more, and takes what gets farthest (by the cross-entropy method; Rubinstein & Kroese, The
Cross-Entropy Method, 2004). It finds good laps, not the best one: what it takes is an upper bound.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress

from benchmarks.result import write_result
from benchmarks.time_trial import FLYING, SEED, limits
from nathlon.policies.checkpoint import NetworkPolicy, load_checkpoint
from nathlon.sim.car import load_car
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from nathlon.sim.world import World

CANDIDATES = 256
ELITE = 24
ROUNDS = 3
SEARCHED, FOLLOWED, TAKEN = 20, 30, 2
"""Actions that are changed, those of the policy after them, and those driven before it is searched anew."""
DEVIATION = np.array([0.25, 0.125])
"""Of the changes at first, of the pedals and of the steering; never less than a tenth of it."""
CORRELATION = 0.7
"""Of a change with the one before it."""
SPEED_WORTH_S = 0.15
"""A candidate's speed at the end counts like the way that it makes in this time."""
OFF_COURSE_COST = 1000.0  # m for each second: whatever stays on the course is better
LAPS = 2
BEFORE_LINE_M = 300.0
"""The search begins so far before the flying lap."""

Array = NDArray[np.float64]


class Laps(NamedTuple):
    """Flying laps, s, and the time off course in the second, s."""

    policy_s: float
    searched_s: float
    off_course_s: float


class Search:
    """A car that drives what the search finds, and worlds in which it tries."""

    def __init__(self, policy: NetworkPolicy, rng: np.random.Generator) -> None:
        """A car at the start of two laps alone."""
        self._policy, self._rng = policy, rng
        self._track, car = load_track(policy.card.circuit), load_car(policy.card.car)
        self.world = World(self._track, car, 1, 1)
        self._trials = World(self._track, car, CANDIDATES, 1)
        scenario = load_scenario(FLYING)
        self.world.reset(0, scenario.place(self._track, np.random.default_rng(SEED)))
        self.world.state["finish"] = np.inf  # else candidates would stop at the line
        self._limit_s = scenario.time_s
        self._changes = np.zeros((SEARCHED, 2))

    @property
    def car(self) -> np.void:
        """CAR_STATE of the car."""
        return self.world.state[0, 0]

    @property
    def late(self) -> bool:
        """Whether its time is up."""
        return bool(self.world.time[0] > self._limit_s)

    @property
    def before_flying_lap(self) -> bool:
        """Whether it has not yet come near the line at which the flying lap begins."""
        return float(self.car["progress"]) < self._track.length - BEFORE_LINE_M

    def drive(self) -> None:
        """Take one action of the policy's."""
        self.world.step(self._actions(self.world))

    def search(self) -> None:
        """Take the next actions of the best that is found."""
        best = self._best()
        for change in best[:TAKEN]:
            self.world.step(np.clip(self._actions(self.world) + change, -1.0, 1.0))
        self._changes = np.concatenate([best[TAKEN:], np.zeros((TAKEN, 2))])

    def _actions(self, world: World) -> Array:
        races = np.arange(len(world.state))
        seen = world.observe(self._policy.observation_spec, races, np.zeros_like(races))
        actions, _ = self._policy.act(seen, self._policy.initial_memory(len(races)))
        return actions[:, None].astype(np.float64)

    def _best(self) -> Array:
        """The best changes to the next actions, (SEARCHED, 2)."""
        mean, deviation = self._changes, np.tile(DEVIATION, (SEARCHED, 1))
        tried = np.zeros((CANDIDATES, SEARCHED, 2))  # the policy as it is stands among the first
        for _ in range(ROUNDS):
            tried[1] = mean
            tried[2:] = mean + deviation * self._noise(CANDIDATES - 2)
            elite = tried[np.argsort(-self._scores(tried), kind="stable")[:ELITE]]
            mean, deviation = elite.mean(axis=0), np.maximum(elite.std(axis=0), 0.1 * DEVIATION)
            tried[0] = elite[0]
        return tried[0]

    def _noise(self, count: int) -> Array:
        noise = self._rng.standard_normal((count, SEARCHED, 2))
        for step in range(1, SEARCHED):
            noise[:, step] = CORRELATION * noise[:, step - 1] + np.sqrt(1.0 - CORRELATION**2) * noise[:, step]
        return noise

    def _scores(self, changes: Array) -> Array:
        """How far each gets, m."""
        for array, row in zip(self._trials.arrays(), self.world.arrays(), strict=True):
            array[:] = row
        for step in range(SEARCHED + FOLLOWED):
            actions = self._actions(self._trials)
            if step < SEARCHED:
                actions = np.clip(actions + changes[:, None, step], -1.0, 1.0)
            self._trials.step(actions)
        cars = self._trials.state[:, 0]
        out = cars["off_course_s"] - self.car["off_course_s"] + cars["wall_s"] - self.car["wall_s"]
        speed = np.hypot(cars["velocity_x"], cars["velocity_y"])
        scores: Array = cars["progress"] + SPEED_WORTH_S * speed - OFF_COURSE_COST * out
        return scores


def flying_lap(search: Search, go_on: Callable[[], None], progress: Progress, name: str) -> float:
    """The time of the flying lap if its actions are those of `go_on`, s.

    Raises:
        InputError: if it is not completed in the scenario's time.
    """
    task = progress.add_task(name, total=LAPS * search.world.track.length)
    while search.car["laps"] < LAPS:
        if search.late:
            raise InputError(f"{name}: no flying lap, expected a policy that comes round")
        if search.before_flying_lap:
            search.drive()
        else:
            go_on()
        progress.update(task, completed=float(search.car["progress"]))
    return float(search.car["last_lap_s"])


def search_laps(policy: NetworkPolicy, progress: Progress, name: str) -> Laps:
    """A flying lap of the policy, and one of the search around it."""
    alone = Search(policy, np.random.default_rng(SEED))
    policy_s = flying_lap(alone, alone.drive, progress, f"{name}, policy")
    search = Search(policy, np.random.default_rng(SEED))
    searched_s = flying_lap(search, search.search, progress, f"{name}, search")
    return Laps(policy_s, searched_s, float(search.car["off_course_s"]))


def main() -> None:
    """Search a lap around each policy, print the figures as JSON."""
    parser = argparse.ArgumentParser(prog="benchmarks.lap_search", description="The fastest lap at 10 Hz")
    parser.add_argument("checkpoints", type=Path, nargs="+", metavar="CHECKPOINT")
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    chosen = parser.parse_args()
    figures = {}
    try:
        with Progress(console=Console(stderr=True)) as progress:
            for path in chosen.checkpoints:
                policy = load_checkpoint(path)
                limit_s = limits().get((policy.card.circuit, policy.card.car))
                laps = search_laps(policy, progress, path.stem)
                figures[path.stem] = {
                    "circuit": policy.card.circuit,
                    "car": policy.card.car,
                    "limit_s": limit_s,
                    **laps._asdict(),
                }
    except InputError as error:
        print(error, file=sys.stderr)
        raise SystemExit(2) from None
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
