"""What a memory is worth to a policy that races by what it sees: the same imitation with and without.

Run as `python -m benchmarks.sight_memory [--out DIR] [--seeds N] [--json FILE]`; the last line of the
output is one JSON object. Runs are `policies/bundled/runs/lindenring-sight.toml` over `ROUNDS` rounds and
`UPDATES` updates; without a memory, the perceptron gets the features of the picture and the sensors as they
are. The last policy of each then drives alone from `STARTS` places anywhere on the lap, the same for all.

- `rounds`, `updates`, `starts`: these;
- `memory`, `no_memory`: by seed, in lists: `metres`, mean distance on the course until a car first spins,
  leaves the course or hits a wall, at most a lap; `off_course_share` of the time, to the end of `SCENARIO`;
  `rounded`: starts after which a car came as far as a whole lap in that time; `loss` of the last round;
- `metres`, `off_course_share`: of each and of `less`, what is lost without a memory with the same seed: mean
  and 95 % interval by Student's t over seeds.

A run takes about two minutes of one core; what has ended is kept in DIR.
"""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import torch
from rich.console import Console
from rich.progress import Progress

from benchmarks.ablation import t_interval
from benchmarks.result import write_result
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.checkpoint import open_checkpoint
from nathlon.policies.policy import Policy
from nathlon.policies.training.ablation import AblationRun, plan
from nathlon.policies.training.config import TrainingConfig, read_config
from nathlon.policies.training.imitation import ROWS, Imitation
from nathlon.policies.training.log import Status
from nathlon.policies.training.mistakes import out_of_control
from nathlon.sim.car import load_car
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track

CONFIG = BUNDLED / "runs" / "lindenring-sight.toml"
ROUNDS, UPDATES, SEEDS = 12, 1_500, 3
SCENARIO, STARTS, STARTS_SEED = "1v0", 24, 63_000
"""Alone from anywhere on the lap; the seed is of the places, and of no race in training."""
MEMORY, NO_MEMORY = "memory", "no_memory"
COMPARED = ("metres", "off_course_share")


def configurations() -> dict[str, TrainingConfig]:
    """With and without, by name."""
    config = read_config(CONFIG)
    assert config.imitation is not None, "it imitates"
    assert config.vision is not None, "it sees"
    imitation = config.imitation.model_copy(update={"rounds": ROUNDS})
    short = {"updates": UPDATES, "checkpoint_every": UPDATES, "imitation": imitation}
    blank = config.vision.model_copy(update={"memory": 0})
    whole = config.model_copy(update=short)
    return {MEMORY: whole, NO_MEMORY: whole.model_copy(update={"vision": blank})}


def train(run: AblationRun, progress: Progress) -> None:
    """Bring a run to its end, if it is not there."""
    if run.last_checkpoint is not None:
        return
    task = progress.add_task(str(run), total=UPDATES)

    def on_status(status: Status) -> None:
        progress.update(task, completed=status.updates)

    run.claim()
    Imitation.resume(run.folder).run(on_status)
    shutil.rmtree(run.folder / ROWS)


def drive(config: TrainingConfig, policy: Policy) -> dict[str, Any]:
    """How a policy drives alone."""
    track, scenario = load_track(config.circuit), load_scenario(SCENARIO)
    world, rng = scenario.world(track, load_car(config.car), STARTS), np.random.default_rng(STARTS_SEED)
    world.state["has_reverse"] = True
    for race in range(STARTS):
        world.reset(race, scenario.place(track, rng))
    spec, memory = policy.observation_spec, policy.initial_memory(STARTS)
    races, cars, state = np.arange(STARTS), np.zeros(STARTS, np.int64), world.state[:, 0]
    begun, metres, controlled = state["progress"].copy(), np.zeros(STARTS), np.ones(STARTS, np.bool_)
    while world.time[0] < scenario.time_s:
        actions, memory = policy.act(world.observe(spec, races, cars), memory)
        world.step(actions[:, None])
        controlled &= ~out_of_control(state)
        metres[controlled] = (state["progress"] - begun)[controlled]
    return {
        "metres": round(float(np.minimum(metres, track.length).mean()), 1),
        "off_course_share": round(float(state["off_course_s"].mean()) / scenario.time_s, 4),
        "rounded": int((state["progress"] - begun >= track.length).sum()),
    }


def measured(run: AblationRun) -> dict[str, Any]:
    """Figures of a run that has ended."""
    assert run.last_checkpoint is not None, "it has ended"
    loss = pl.read_csv(run.curve, null_values="nan")["loss"][-1]
    return drive(run.config, open_checkpoint(run.last_checkpoint)) | {"loss": round(loss, 4)}


def compared(found: dict[str, dict[str, list[float]]], name: str) -> dict[str, Any]:
    """Means and intervals over seeds of a figure, with and without, and of the difference."""
    values = {kind: np.array(found[kind][name]) for kind in found}
    values["less"] = values[MEMORY] - values[NO_MEMORY]
    return {
        kind: [round(float(each), 4) for each in (of.mean(), *(t_interval(of.tolist()) or ()))]
        for kind, of in values.items()
    }


def main() -> None:
    """Train what is missing, let all drive, print the figures as JSON."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("runs/sight-memory"), help="folder of the runs")
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    found: dict[str, dict[str, list[float]]] = {MEMORY: {}, NO_MEMORY: {}}
    with Progress(console=Console(stderr=True)) as progress:
        for run in plan(configurations(), chosen.seeds, chosen.out):
            train(run, progress)
            for name, value in measured(run).items():
                found[run.variant].setdefault(name, []).append(value)
    figures = {"rounds": ROUNDS, "updates": UPDATES, "starts": STARTS, **found}
    figures |= {name: compared(found, name) for name in COMPARED}
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
