"""Returns of QR-SAC on Gymnasium's continuous-control tasks beside those that others published.

Run as `python -m benchmarks.known_answers --json FILE`, with `--tasks` and `--seeds` for fewer or more. Needs
`gymnasium[mujoco]`. Each finished run is kept in the file at once; called again, the runs that are missing
are made. 300,000 steps take most of an hour on one core; `--until 100000` ends runs before, and another call
without makes them whole, from their beginning. `--precision bfloat16`, with a file of its own, tells whether
matrix products in that format learn as well, on processors without it too. The entries of the JSON, by task:

- `runs`: by seed and environment steps, the mean return (not discounted) of ten episodes driven by the
  mean of the policy;
- `mean`, `std`, `seeds`: of these over the seeds that came so far, and how many did;
- `published`: what others report, by steps, with the spread that they give;
- `config`: the hyperparameters.

nnabla-rl's curves are of its QRSAC, 3 seeds, MuJoCo's version 2 of the tasks, with an entropy weight that is
tuned during training (ours is fixed), ten episodes a seed; the spread is that over all episodes:
https://github.com/sony/nnabla-rl/tree/master/reproductions/algorithms/mujoco/qrsac. rl-baselines3-zoo's are
of one run of Stable-Baselines3's SAC each, version 3 of the tasks, also tuned, and the spread is that over
episodes: https://github.com/DLR-RM/rl-baselines3-zoo/blob/master/benchmark.md.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, get_args

import gymnasium
import numpy as np
import torch
from rich.console import Console
from rich.progress import track

from benchmarks.result import read_result, write_result
from nathlon.policies.qrsac.config import QRSACConfig
from nathlon.policies.qrsac.gymnasium_training import GymnasiumTraining, evaluate

EPISODES = 10
EVALUATION_SEED = 10_000

PRECISIONS = get_args(QRSACConfig.model_fields["precision"].annotation)

Published = dict[str, dict[int, tuple[float, float]]]


@dataclass(frozen=True)
class Task:
    """What is trained on one environment.

    Attributes:
        evaluate_at: environment steps after which the policy is evaluated; the last one ends the run.
        warm_up: steps with random actions.
        config: hyperparameters.
        published: returns of others with their spread, by steps.
    """

    evaluate_at: tuple[int, ...]
    warm_up: int
    config: QRSACConfig
    published: Published


def locomotion(published: Published) -> Task:
    """A MuJoCo task with the usual hyperparameters of SAC."""
    config = QRSACConfig(
        hidden=(256, 256),
        n_step=1,
        gamma=0.99,
        alpha=0.2,
        critic_rate=3e-4,
        policy_rate=3e-4,
        dropout=0.0,
        batch=256,
    )
    return Task((100_000, 300_000), 10_000, config, published)


TASKS = {
    "Pendulum-v1": Task(
        (5_000, 20_000),
        1_000,
        QRSACConfig(
            hidden=(64, 64),
            n_step=1,
            gamma=0.98,
            alpha=0.2,
            critic_rate=1e-3,
            policy_rate=1e-3,
            dropout=0.0,
            batch=128,
        ),
        {"rl-baselines3-zoo SAC": {20_000: (-157.0, 88.7)}},
    ),
    "Hopper-v5": locomotion(
        {
            "nnabla-rl QRSAC": {100_000: (656.5, 359.3), 300_000: (1819.8, 1054.0)},
            "rl-baselines3-zoo SAC": {1_000_000: (2325.5, 1129.7)},
        }
    ),
    "Walker2d-v5": locomotion(
        {
            "nnabla-rl QRSAC": {100_000: (470.0, 250.8), 300_000: (3436.9, 598.2)},
            "rl-baselines3-zoo SAC": {1_000_000: (3863.2, 254.3)},
        }
    ),
    "HalfCheetah-v5": locomotion(
        {
            "nnabla-rl QRSAC": {100_000: (4835.0, 99.0), 300_000: (7770.1, 481.2)},
            "rl-baselines3-zoo SAC": {1_000_000: (9535.5, 100.5)},
        }
    ),
}


def with_precision(task: Task, precision: str) -> Task:
    """The task with matrix products in another float format."""
    return replace(task, config=task.config.model_copy(update={"precision": precision}))


def until(task: Task, steps: int) -> Task:
    """The task with its first evaluations only, those after no more steps."""
    return replace(task, evaluate_at=tuple(at for at in task.evaluate_at if at <= steps))


def returns(name: str, task: Task, seed: int) -> dict[str, float]:
    """Mean returns of one run by steps."""
    environments = gymnasium.make_vec(name, num_envs=1)
    training = GymnasiumTraining(environments, task.config, seed, warm_up=task.warm_up)
    means = {}
    for steps in task.evaluate_at:
        training.advance(steps - training.steps)
        episodes = evaluate(training.learner, gymnasium.make_vec(name, num_envs=EPISODES), EVALUATION_SEED)
        means[str(steps)] = round(float(episodes.mean()), 1)
    return means


def entry(task: Task, runs: dict[str, dict[str, float]]) -> dict[str, Any]:
    """What the file says of a task."""
    steps = sorted({steps for run in runs.values() for steps in run}, key=int)
    by_steps = {at: [run[at] for run in runs.values() if at in run] for at in steps}
    return {
        "runs": runs,
        "mean": {steps: round(float(np.mean(values)), 1) for steps, values in by_steps.items()},
        "std": {steps: round(float(np.std(values)), 1) for steps, values in by_steps.items()},
        "seeds": {steps: len(values) for steps, values in by_steps.items()},
        "published": task.published,
        "config": task.config.model_dump(mode="json"),
    }


def main() -> None:
    """Make the runs that the file does not have yet, showing progress on stderr."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, required=True, metavar="FILE")
    parser.add_argument("--tasks", nargs="+", choices=TASKS, default=list(TASKS))
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--until", type=int, default=10**9, metavar="STEPS")
    parser.add_argument("--precision", choices=PRECISIONS, default="auto")
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    tasks = {
        name: until(with_precision(TASKS[name], options.precision), options.until) for name in options.tasks
    }
    torch.set_num_threads(options.threads)
    file: Path = options.json
    found: dict[str, Any] = read_result(file).figures if file.exists() else {}
    for name, task in tasks.items():
        if found.get(name, {}).get("config", task.config.model_dump(mode="json")) != task.config.model_dump(
            mode="json"
        ):
            parser.error(f"{file}: {name}: holds runs of another configuration, expected a file of its own")
    missing = [
        (name, seed)
        for name in tasks
        for seed in options.seeds
        if not {str(steps) for steps in tasks[name].evaluate_at}
        <= set(found.get(name, {}).get("runs", {}).get(str(seed), {}))
    ]
    for name, seed in track(missing, "Runs", console=Console(stderr=True)):
        runs = found.get(name, {}).get("runs", {}) | {str(seed): returns(name, tasks[name], seed)}
        found[name] = entry(tasks[name], runs)
        write_result(file, found, {"gymnasium": version("gymnasium")})


if __name__ == "__main__":
    main()
