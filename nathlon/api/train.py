"""`nathlon.train`: QR-SAC in the simulator, or imitation, and what it leaves."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import polars as pl
import torch

from nathlon.arena.on_ray.cluster import AUTO, joined
from nathlon.policies.training.config import CONFIGS, TrainingConfig, read_config
from nathlon.policies.training.imitation import Imitation
from nathlon.policies.training.log import Status
from nathlon.policies.training.run_folder import read_run_folder
from nathlon.policies.training.trainer import Device, Trainer
from nathlon.policies.training.worker_pool import MakeWorkers, local_workers
from nathlon.results.words import percent
from nathlon.sim.data_file import find_data
from nathlon.sim.errors import InputError
from nathlon.sim.folder_lock import sole_user
from nathlon.sim.scenario import load_scenario
from nathlon.terminal import warn
from nathlon.terminal.progress import progress_bars


class TrainingResult:
    """What a training run has left.

    Attributes:
        folder: of the run.
        updates: gradient updates so far.
    """

    def __init__(self, folder: Path, updates: int) -> None:
        self.folder, self.updates = folder, updates

    @property
    def checkpoints(self) -> list[Path]:
        """The oldest first; `nathlon.select` takes them."""
        return sorted((self.folder / "checkpoints").glob("*.safetensors"))

    @property
    def curve(self) -> pl.DataFrame:
        """A row for each checkpoint: its updates, transitions, lap in s, and so on."""
        return pl.read_csv(self.folder / "curve.csv", null_values="nan")

    def __repr__(self) -> str:
        return f"{self.updates:,} updates, {len(self.checkpoints)} checkpoints in {self.folder}"


def train(
    config: str | Path = "time_trial",
    out: str | Path = "runs/training",
    *,
    seed: int = 1,
    threads: int | None = None,
    device: Device = "cpu",
    engine: Literal["local", "ray"] = "local",
    engine_address: str = AUTO,
    resume: bool = False,
    origin: str | Path | None = None,
    coach: Sequence[str | Path] = (),
    progress: bool = True,
) -> TrainingResult:
    """Train a policy to the end of a configuration, or until Ctrl-C; the state is kept.

    Args:
        config: shipped name (`time_trial`, `racing`, ...) or path of a `.toml` file.
        out: folder of the run.
        seed: of all randomness.
        threads: of the learner; as many as the rollout workers leave by default.
        device: where networks are updated.
        engine: who runs the rollout workers: this machine, or the nodes of a Ray cluster.
        engine_address: of the cluster; `auto` for the one that this machine is part of.
        resume: go on with the run in the folder.
        origin: folder of a run whose networks this one starts with, or a checkpoint whose policy.
        coach: what `nathlon coach` has left of laps (coach.json): where they lost most, a fifth of the races
            of one car begin.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if the configuration is wrong, the folder holds a run already or none to resume, another
            process trains there, training diverges, the disk is full, or there is no such cluster.
        KeyboardInterrupt: after Ctrl-C, once the state is kept.
    """
    folder = Path(out)
    logging.basicConfig(format="%(message)s")
    if resume and (origin is not None or coach):
        raise InputError("origin, coach: expected for a new run, not with resume")
    if resume:
        read_run_folder(folder)
    with sole_user(folder), _rollouts(engine, engine_address) as make_workers:
        trainer: Trainer | Imitation
        if resume:
            trainer = _resumed(folder, device)
        else:
            settings = read_config(find_data(str(config), "training configuration", CONFIGS))
            _check_workers(settings, engine)
            start = None if origin is None else Path(origin)
            if settings.imitation is None:
                trainer = Trainer.start(folder, _with_coach(settings, coach), seed, start, device)
            else:
                _check_imitation(coach, device, engine)
                trainer = Imitation.start(folder, settings, seed, start)
        _check_workers(trainer.config, engine)
        beside = trainer.config.workers if engine == "local" else 0
        # Two threads of matrix products beside a busy process are slower than one.
        torch.set_num_threads(threads or max((os.cpu_count() or 1) - beside, 1))
        if progress and isinstance(trainer, Trainer):
            warn(f"Training in {folder}; the replay buffer may take {trainer.replay.nbytes / 1e9:.1f} GB.")
        with progress_bars(progress) as bars:
            task = bars.add_task("updates", total=trainer.config.updates, note="warming up")

            def on_status(status: Status) -> None:
                lap = "no lap yet" if math.isnan(status.lap_s) else f"lap {status.lap_s:.1f} s"
                note = (
                    f"{status.updates_per_s:.0f}/s, {lap}, {percent(status.off_course_share, 1)} off course"
                )
                bars.update(task, completed=status.updates, note=note)

            def on_pair(ready: int, count: int) -> None:
                bars.update(task, note=f"{ready} of {count} circuits and cars practised")

            if isinstance(trainer, Trainer):
                trainer.run(on_status, on_pair, make_workers)
            else:
                trainer.run(on_status, on_pair)
    return TrainingResult(folder.absolute(), trainer.updates)


@contextmanager
def _rollouts(engine: str, address: str) -> Iterator[MakeWorkers]:
    """What starts the rollout workers."""
    if engine == "local":
        yield local_workers
        return
    with joined(address):
        from nathlon.policies.training.on_ray.workers import RayWorkers

        yield RayWorkers


def _resumed(folder: Path, device: Device) -> Trainer | Imitation:
    """The run in a folder, of whichever kind it is."""
    if read_run_folder(folder)[0].imitation is None:
        return Trainer.resume(folder, device)
    return Imitation.resume(folder)


def _check_imitation(coach: Sequence[str | Path], device: Device, engine: str) -> None:
    """Refuse what only learning from rewards knows."""
    for name, given in (
        ("coach", bool(coach)),
        ("device", device != "cpu"),
        ("engine", engine != "local"),
    ):
        if given:
            raise InputError(f"{name}: expected for training by rewards, not by imitation")


def _check_workers(config: TrainingConfig, engine: str) -> None:
    if engine == "ray" and not config.workers:
        raise InputError("workers is 0, expected how many rollout workers the cluster is to run")
    if engine == "ray" and config.vision:
        raise InputError("vision: pictures stay on this machine, expected engine local")


def _with_coach(config: TrainingConfig, files: Sequence[str | Path]) -> TrainingConfig:
    """A configuration with the start states of a coach's files besides its own."""
    if not files:
        return config
    from nathlon.policies.training.coached import read_coach

    if all(load_scenario(rollouts.scenario).cars > 1 for rollouts in config.rollouts):
        raise InputError("coach: no rollouts of the configuration have one car, expected some that do")
    found = [start for file in files for start in read_coach(Path(file), config.circuit, config.car)]
    return config.model_copy(update={"coached": (*config.coached, *found)})
