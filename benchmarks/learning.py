"""How long training takes from scratch to the built-in driver's lap: time trials on two cores.

`python -m benchmarks.learning --json FILE [--seeds N] [--circuit NAME ...]` trains with each time-trial
configuration that comes with nathlon, seed after seed, until a checkpoint's mean lap is no slower than the
built-in driver's, with less than 1 % of the time off the course; a run without success ends with its
configuration, or at the time limit. The runs lie in a folder beside the JSON. Ctrl-C stops; the same command
goes on, and seeds that are done are not done again.

The JSON has, by circuit, `car`, `cores`, `driver_lap_s`, `configuration` and

- `seeds`: by seed whether the driver's lap was `reached`, and of the checkpoint that did, else of the last,
  `wall_s` (the run's wall time up to it), `updates`, `lap_s` and `off_course_share`; the time is as fine as
  the configuration's `checkpoint_every`;
- `median_wall_s`: over the seeds that are done, runs without success being the slowest; null if that falls
  on one of them.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import polars as pl
import torch
from pydantic import BaseModel, TypeAdapter, ValidationError, computed_field
from rich import box
from rich.console import Console
from rich.table import Table

from benchmarks.result import read_result, write_result
from benchmarks.time_trial import drive_alone
from nathlon.arena.entrant import enter
from nathlon.policies.sources import DRIVER
from nathlon.policies.training.config import CONFIGS, TrainingConfig, read_config
from nathlon.policies.training.log import CURVE_FILE, Status
from nathlon.policies.training.run_folder import CONFIG_FILE
from nathlon.policies.training.state import REPLAY_FILE
from nathlon.policies.training.trainer import Trainer
from nathlon.sim.errors import InputError
from nathlon.sim.validation import first_fault
from nathlon.terminal import say
from nathlon.terminal.progress import progress_bars

CORES = 2
MOST_OFF_COURSE = 0.01
LIMIT_H = 6.0


class Outcome(BaseModel):
    """How far a run has come: its first checkpoint with the driver's lap, or its last one."""

    reached: bool
    wall_s: float
    updates: int
    lap_s: float | None  # None unless all laps of the evaluation were completed
    off_course_share: float


class Learning(BaseModel):
    """The runs of one configuration."""

    car: str
    cores: int
    driver_lap_s: float
    configuration: TrainingConfig
    seeds: dict[int, Outcome] = {}

    @computed_field  # type: ignore[prop-decorator]
    @property
    def median_wall_s(self) -> float | None:
        """Median over the seeds; None without any, or if it falls on one without success."""
        walls = [seed.wall_s if seed.reached else math.inf for seed in self.seeds.values()]
        median = float(np.median(walls)) if walls else math.inf
        return median if math.isfinite(median) else None


Measured = TypeAdapter(dict[str, Learning])


class Settled(Exception):
    """A run has shown what it was made for."""


def configurations(circuits: Sequence[str]) -> dict[str, TrainingConfig]:
    """The time-trial configurations by circuit, of the circuits given or of all.

    They keep their replay tables over a stop, or going on would take a second warm-up.

    Raises:
        InputError: if there is none for one of the circuits.
    """
    configs = [read_config(path) for path in sorted(CONFIGS.glob("*time_trial.toml"))]
    found = {config.circuit: config.model_copy(update={"keep_replay": True}) for config in configs}
    for circuit in circuits:
        if circuit not in found:
            known = ", ".join(found)
            raise InputError(f"circuit {circuit}: no time-trial configuration, expected one of {known}")
    return {circuit: found[circuit] for circuit in circuits or found}


def outcome(folder: Path, driver_lap_s: float) -> Outcome | None:
    """How far the run in a folder has come by its curve; None before the first checkpoint."""
    if not (folder / CURVE_FILE).exists():
        return None
    rows = pl.read_csv(folder / CURVE_FILE, null_values="nan", schema_overrides={"lap_s": pl.Float64})
    there = rows.filter(pl.col("lap_s") <= driver_lap_s, pl.col("off_course_share") < MOST_OFF_COURSE)
    row = (rows.tail(1) if there.is_empty() else there.head(1)).row(0, named=True)
    return Outcome.model_validate({**row, "reached": not there.is_empty()})


def learn(folder: Path, config: TrainingConfig, seed: int, driver_lap_s: float, limit_s: float) -> Outcome:
    """Train from scratch, or go on in the folder, until the driver's lap, the end or the time limit.

    Raises:
        InputError: if the folder holds a run of another configuration, or training fails.
    """
    begun = (folder / CONFIG_FILE).exists()
    trainer = Trainer.resume(folder) if begun else Trainer.start(folder, config, seed)
    if trainer.config != config:
        raise InputError(f"{folder}: holds a run of another configuration, expected the present one")

    def check() -> None:
        so_far = outcome(folder, driver_lap_s)
        if so_far and (so_far.reached or so_far.wall_s >= limit_s):
            raise Settled

    with progress_bars() as progress, suppress(Settled):
        task = progress.add_task(f"{config.circuit} {seed}", total=config.updates, note="warming up")

        def on_status(status: Status) -> None:
            note = f"{status.updates_per_s:.0f}/s, lap {status.lap_s:.1f} s"
            progress.update(task, completed=status.updates, note=note)
            check()

        check()
        trainer.run(on_status)
    (folder / REPLAY_FILE).unlink(missing_ok=True)
    came = outcome(folder, driver_lap_s)
    if came is None:
        raise InputError(f"{folder}: training ended without a checkpoint, expected at least one")
    return came


def read(path: Path) -> dict[str, Learning]:
    """What was measured before, by circuit.

    Raises:
        InputError: if it cannot be read.
    """
    if not path.exists():
        return {}
    try:
        return Measured.validate_python(read_result(path).figures)
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error, Learning)}") from None


def write(path: Path, measured: dict[str, Learning]) -> None:
    """Write the JSON, whole or not at all."""
    write_result(path, Measured.dump_python(measured, mode="json"))


def measure(
    path: Path, configs: dict[str, TrainingConfig], seeds: int, limit_s: float
) -> dict[str, Learning]:
    """All seeds of all configurations, each kept in the file as soon as it is done.

    Raises:
        InputError: if the file holds measurements of another configuration, or training fails.
    """
    measured = read(path)
    for circuit, config in configs.items():
        if circuit not in measured:
            lap_s = round(drive_alone(enter(DRIVER, circuit, config.car)).lap_s, 3)
            measured[circuit] = Learning(
                car=config.car, cores=CORES, driver_lap_s=lap_s, configuration=config
            )
        learning = measured[circuit]
        if learning.configuration != config:
            raise InputError(f"{path}: {circuit}: another configuration, expected the present one")
        torch.set_num_threads(max(1, CORES - config.workers))
        for seed in range(1, seeds + 1):
            if seed not in learning.seeds:
                folder = path.with_suffix("") / circuit / f"seed-{seed}"
                learning.seeds[seed] = learn(folder, config, seed, learning.driver_lap_s, limit_s)
                write(path, measured)
    return measured


def table(measured: dict[str, Learning]) -> Table:
    """The figures for people."""
    heads = ("circuit", "car", "driver's lap, s", "each seed, min", "median, min")
    rendered = Table(*heads, box=box.MARKDOWN)
    for circuit, learning in measured.items():
        times = [_minutes(seed.wall_s if seed.reached else None) for seed in learning.seeds.values()]
        rendered.add_row(
            circuit,
            learning.car,
            f"{learning.driver_lap_s:.3f}",
            ", ".join(times),
            _minutes(learning.median_wall_s),
        )
    return rendered


def _minutes(seconds: float | None) -> str:
    return "not reached" if seconds is None else f"{seconds / 60:.1f}"


def main() -> None:
    """Train, keep the figures, print the table."""
    parser = argparse.ArgumentParser(
        prog="benchmarks.learning", description="From scratch to the driver's lap"
    )
    parser.add_argument("--json", type=Path, required=True, help="the figures, continued if it is there")
    parser.add_argument("--seeds", type=int, default=3, help="runs of each configuration")
    parser.add_argument("--circuit", nargs="+", action="extend", default=[], help="train only on these")
    parser.add_argument("--limit-h", type=float, default=LIMIT_H, help="hours until a run is given up")
    chosen = parser.parse_args()
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:CORES])
    try:
        measured = measure(chosen.json, configurations(chosen.circuit), chosen.seeds, 3600 * chosen.limit_h)
    except InputError as error:
        parser.error(str(error))
    except KeyboardInterrupt:
        say("Stopped. The same command goes on.")
        sys.exit(130)
    Console(width=100).print(table(measured))


if __name__ == "__main__":
    main()
