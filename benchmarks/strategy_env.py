"""Strategists that have learnt when to stop, against the planner: `nathlon/Strategy-v0`.

Run as `python -m benchmarks.strategy_env --json FILE [--steps N] [--races N]`. Stable-Baselines3's DQN and
PPO learn from `steps` laps each, with its own settings, as in `examples/sb3_strategy.py`. Then they, the
planner and the best fixed plan drive the same `races`, whose seeds no training has seen, each against seven
planners. The best fixed plan is that with the highest mean return in TRIED races with other seeds, of those
with up to three stops and even stints on one compound.

By strategist: mean `return`; the share of races that it `finished`, and of these the mean `time_s`; mean
`place`, with the 95 % interval of the places `gained` on the planner; mean `stops`; and `train_s`, the
processor time of learning.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch
from scipy.stats import t as students

from benchmarks.result import write_result
from examples.sb3_strategy import ALGORITHMS
from nathlon.policies.environments.strategy_env import SHIPPED, StrategyEnv, model_of

FIRST_HELD_OUT = 100_000
TRIED = 50
STOPS = (0, 1, 2, 3)
PLANNER = "planner"
LAPS = 12
SEED = 1

Decide = Callable[[Any, int], int]
"""An action for an observation and the number of the step, 0 on the grid."""


class Raced(NamedTuple):
    """What came of a race."""

    returned: float
    finished: bool
    time_s: float
    place: int
    stops: int


def raced(env: gymnasium.Env[Any, Any], decide: Decide, seed: int) -> Raced:
    """One race."""
    seen, _ = env.reset(seed=seed)
    facts: dict[str, Any] = {}
    returned, over, step = 0.0, False, 0
    while not over:
        seen, reward, over, _, facts = env.step(decide(seen, step))
        returned, step = returned + float(reward), step + 1
    out = bool(facts["out"])
    return Raced(returned, not out, facts["time_s"], facts["place"], facts["stops"])


def even(stops: int, action: int) -> Decide:
    """A plan of even stints, all on the compound of an action."""
    ends = np.rint(np.linspace(0, LAPS, stops + 2)).astype(int)[1:-1].tolist()
    return lambda _, step: action if step == 0 or step in ends else 0


def best_fixed(env: gymnasium.Env[Any, Any]) -> tuple[str, Decide]:
    """The fixed plan with the highest mean return, and its name."""
    compounds = [compound.name for compound in model_of(str(SHIPPED)).compound]
    plans = {
        f"{compounds[action - 1]}, stops: {stops}": even(stops, action)
        for stops, action in product(STOPS, range(1, len(compounds) + 1))
    }
    returns = {
        name: np.mean([raced(env, plan, seed).returned for seed in range(1, TRIED + 1)])
        for name, plan in plans.items()
    }
    best = max(returns, key=returns.__getitem__)
    return best, plans[best]


def learnt(env: gymnasium.Env[Any, Any], algorithm: str, steps: int) -> Decide:
    """What an algorithm has learnt."""
    model = ALGORITHMS[algorithm]("MlpPolicy", env, seed=SEED, device="cpu").learn(steps)
    return lambda seen, _: int(model.predict(seen, deterministic=True)[0])


def figures(races: Sequence[Raced], planner: Sequence[Raced]) -> dict[str, Any]:
    """Of a strategist; see the top."""
    table, gained = (
        np.array(races),
        np.array([was.place - one.place for one, was in zip(races, planner, strict=True)]),
    )
    reach = students.ppf(0.975, len(gained) - 1) * gained.std(ddof=1) / np.sqrt(len(gained))
    finished = table[:, 1] > 0.0
    return {
        "return": round(float(table[:, 0].mean()), 1),
        "finished": round(float(finished.mean()), 3),
        "time_s": round(float(table[finished, 2].mean()), 1) if finished.any() else None,
        "place": round(float(table[:, 3].mean()), 2),
        "gained": [round(float(gained.mean() + side * reach), 2) for side in (-1.0, 0.0, 1.0)],
        "stops": round(float(table[:, 4].mean()), 2),
    }


def measure(steps: int, races: int) -> dict[str, Any]:
    """The figures of all strategists."""
    env = gymnasium.make("nathlon/Strategy-v0", laps=LAPS)
    planner = env.unwrapped
    assert isinstance(planner, StrategyEnv), "it was made by this name"
    fixed, plan = best_fixed(env)
    deciders: dict[str, Decide] = {PLANNER: lambda _seen, _step: planner.planned(), "fixed": plan}
    train_s = {}
    for name in ALGORITHMS:
        began = time.process_time()
        deciders[name] = learnt(env, name, steps)
        train_s[name] = round(time.process_time() - began, 1)
    seeds = range(FIRST_HELD_OUT, FIRST_HELD_OUT + races)
    driven = {name: [raced(env, decide, seed) for seed in seeds] for name, decide in deciders.items()}
    return {
        "laps": LAPS,
        "steps": steps,
        "races": races,
        "fixed": fixed,
        "train_s": train_s,
        "strategists": {name: figures(one, driven[PLANNER]) for name, one in driven.items()},
    }


def main() -> None:
    """Measure, and print the figures as one JSON object."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=50_000)
    parser.add_argument("--races", type=int, default=200)
    options = parser.parse_args()
    torch.set_num_threads(1)
    told = measure(options.steps, options.races)
    write_result(options.json, told)
    print(json.dumps(told))


if __name__ == "__main__":
    main()
