"""Train policies for one of these worlds with Stable-Baselines3, and keep checkpoints on the way.

python -m examples.worlds.train tag runs/tag-1 --seed 1

OUT/returns.json has, by checkpoint, the mean return of the last hundred episodes before it. Where a world has
roles, each is trained by itself, and OUT/NAME.roles.toml names the checkpoints of equally many steps.
"""

from __future__ import annotations

import argparse
import json
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor


class Task(NamedTuple):
    """What is trained for a world: in which environment, for so many steps, in which seats or roles."""

    make: str
    steps: int
    seats: tuple[str, ...] = ()
    roles: tuple[str, ...] = ()


TASKS = {
    "tag": Task("tag", 24_000, ("adversary_0", "adversary_1", "adversary_2")),
    "pursuit": Task("pursuit", 24_000, roles=("chaser", "prey")),
    "walkers": Task("walk", 30_000, ("walker_0", "walker_1", "walker_2")),
    "four": Task("Four", 24_000, ("player_0", "player_1")),
    "foraging": Task("foraging", 12_000, ("player_0", "player_1")),
    "circuit": Task("Circuit", 8_000, ("car_0",)),
    "carracing": Task("drive", 4_000),
    "slime": Task("volley", 24_000, ("left", "right")),
    "old_gym": Task("pole", 12_000),
}
CHECKPOINTS = 12


class OneSeat(gymnasium.Env[Any, Any]):
    """A ParallelEnv as an environment of one agent, who takes one of some seats, another every episode.

    In half of the episodes the rest of them are its copies. Whoever else plays draws actions.
    """

    copies: PPO | None = None

    def __init__(self, environment: Any, seats: tuple[str, ...], seed: int) -> None:
        self._environment, self._seats = environment, seats
        self._rng = np.random.default_rng(seed)
        self._seat, self._with_copies, self._seen = seats[0], False, dict[str, Any]()
        self.observation_space = environment.observation_space(seats[0])
        self.action_space = environment.action_space(seats[0])

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        """As of Env."""
        self._seat, self._with_copies = str(self._rng.choice(self._seats)), bool(self._rng.integers(2))
        self._seen, _ = self._environment.reset(seed=int(self._rng.integers(2**31)))
        return self._seen[self._seat], {}

    def step(self, action: Any) -> Any:
        """As of Env."""
        others = [name for name in self._environment.agents if name != self._seat]
        actions = {self._seat: action} | {name: self._action(name) for name in others}
        self._seen, rewards, ends, cuts, _ = self._environment.step(actions)
        return self._seen[self._seat], rewards[self._seat], ends[self._seat], cuts[self._seat], {}

    def _action(self, name: str) -> Any:
        if self._with_copies and name in self._seats and self.copies is not None:
            return self.copies.predict(self._seen[name])[0]
        space = self._environment.action_space(name)
        space.seed(int(self._rng.integers(2**31)))
        return space.sample()


def train(world: str, out: Path, seed: int) -> None:
    """Train with PPO, each role by itself, and save checkpoints in equal steps."""
    task, module = TASKS[world], import_module(f"examples.worlds.{world}")
    returns: dict[str, float] = {}
    for role in task.roles:
        returns |= _train(module, task._replace(seats=tuple(module.ROLES[role])), out / role, role, seed)
    if not task.roles:
        returns = _train(module, task, out, world, seed)
    (out / "returns.json").write_text(json.dumps(returns, indent=1), "utf-8")
    for step in range(1, CHECKPOINTS + 1) if task.roles else ():
        named = f"{seed}_{step * (task.steps // CHECKPOINTS):06}"
        lines = [f'{role} = "{role}/{role}_{named}.zip"' for role in task.roles]
        (out / f"{world}_{named}.roles.toml").write_text("\n".join(["[roles]", *lines, ""]), "utf-8")


def _train(module: ModuleType, task: Task, out: Path, called: str, seed: int) -> dict[str, float]:
    """Train for some seats; the mean returns by the names of the checkpoints, which begin with `called`."""
    out.mkdir(exist_ok=True)
    environment = getattr(module, task.make)()
    alone = OneSeat(environment, task.seats, seed) if task.seats else environment
    model = PPO("MlpPolicy", Monitor(alone), n_steps=500, batch_size=100, seed=seed, device="cpu")
    if isinstance(alone, OneSeat):
        alone.copies = model
    returns: dict[str, float] = {}
    for _ in range(CHECKPOINTS):
        model.learn(task.steps // CHECKPOINTS, reset_num_timesteps=False)
        name = f"{called}_{seed}_{model.num_timesteps:06}"
        model.save(out / name)
        returns[name] = float(np.mean([episode["r"] for episode in model.ep_info_buffer or ()]))
        print(f"{name}: {returns[name]:.2f}", flush=True)
    return returns


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Train policies for one of the example worlds")
    parser.add_argument("world", choices=TASKS)
    parser.add_argument("out", type=Path, help="folder for the checkpoints")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    torch.set_num_threads(1)
    given.out.mkdir(parents=True, exist_ok=True)
    train(given.world, given.out, given.seed)


if __name__ == "__main__":
    main()
