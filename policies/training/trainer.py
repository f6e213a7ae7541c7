"""The training run: rollouts and updates by turns, logs, checkpoints, and going on after a stop."""

from __future__ import annotations

import csv
import json
import os
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import torch
from pydantic import ValidationError
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch.utils.tensorboard import SummaryWriter

from policies.checkpoint import Card, save_checkpoint
from policies.qrsac.learner import QRSAC
from policies.replay import NStepReplay
from policies.training.config import TrainingConfig
from policies.training.evaluation import evaluate_laps
from policies.training.rollout import Rollout, Step
from sim.errors import InputError, first_fault

CONFIG_FILE = "run.json"
STATE_FILE = "state.safetensors"
CURVE_FILE = "curve.csv"
CURVE = ("updates", "transitions", "wall_s", "lap_s", "off_course_share", "mean_q", "entropy")
ACTION_SIZE = 2
LOG_EVERY = 250


@dataclass(frozen=True)
class Status:
    """Where a run stands."""

    updates: int
    transitions: int
    updates_per_s: float
    lap_s: float  # mean of the last laps in training; nan before the first
    off_course_share: float  # in training, lately


class Trainer:
    """One training run in a folder of its own."""

    def __init__(self, folder: Path, config: TrainingConfig, seed: int) -> None:
        """A run at its beginning; nothing is written yet."""
        self.folder, self.config, self.seed = folder, config, seed
        streams = np.random.SeedSequence(seed).spawn(2 + len(config.rollouts))
        self._replay_rng = np.random.default_rng(streams[0])
        generator = torch.Generator().manual_seed(int(streams[1].generate_state(1)[0]))
        self._spec = config.observation.spec()
        self.learner = QRSAC(self._spec.size, ACTION_SIZE, config.qrsac, generator)
        self._rollouts = [
            Rollout(config, rollouts, np.random.default_rng(stream))
            for rollouts, stream in zip(config.rollouts, streams[2:], strict=True)
        ]
        slots = sum(rollout.slots for rollout in self._rollouts)
        self.replay = NStepReplay(
            config.replay, slots, self._spec.size, ACTION_SIZE, config.qrsac.n_step, config.qrsac.gamma
        )
        self.updates = self.transitions = 0
        self._wall_s = 0.0
        self._laps: deque[float] = deque(maxlen=40)
        self._off_course: deque[tuple[float, float]] = deque(maxlen=400)
        self._metrics: dict[str, torch.Tensor] = {}
        self._components: dict[str, float] = {}

    @classmethod
    def start(cls, folder: Path, config: TrainingConfig, seed: int) -> Trainer:
        """Begin a run in a new folder.

        Raises:
            InputError: if the folder already holds a run or cannot be made.
        """
        if (folder / CONFIG_FILE).exists():
            raise InputError(f"{folder}: holds a training run already; resume it or choose another folder")
        trainer = cls(folder, config, seed)
        try:
            (folder / "checkpoints").mkdir(parents=True, exist_ok=True)
            _write_text(
                folder / CONFIG_FILE, json.dumps({"seed": seed, "config": config.model_dump()}, indent=1)
            )
        except OSError as error:
            raise InputError(f"{folder}: cannot be written: {error.strerror}") from None
        return trainer

    @classmethod
    def resume(cls, folder: Path) -> Trainer:
        """Go on with the run in a folder; its replay buffer fills anew.

        Raises:
            InputError: if the folder holds no run, or one that cannot be read.
        """
        path = folder / CONFIG_FILE
        try:
            facts = json.loads(path.read_text("utf-8"))
            trainer = cls(folder, TrainingConfig.model_validate(facts["config"]), int(facts["seed"]))
        except OSError:
            raise InputError(f"{path}: no training run to resume") from None
        except ValidationError as error:
            raise InputError(f"{path}: {first_fault(error)}") from None
        except (ValueError, KeyError, TypeError):
            raise InputError(f"{path}: expected the JSON of a training run with config and seed") from None
        if (folder / STATE_FILE).exists():
            trainer._load_state()
        return trainer

    def _load_state(self) -> None:
        path = self.folder / STATE_FILE
        try:
            tensors = load_file(path)
        except (OSError, SafetensorError) as error:
            raise InputError(f"{path}: not the state of a training run: {error}") from None
        counts = tensors.pop("counts", torch.zeros(0))
        if counts.shape != (3,):
            raise InputError(f"{path}: tensor counts: expected 3 numbers")
        try:
            self.learner.load_state_dict(tensors)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        self.updates, self.transitions, self._wall_s = int(counts[0]), int(counts[1]), float(counts[2])
        # Episodes to come must not repeat those before the stop.
        self._replay_rng = np.random.default_rng([self.seed, self.updates])

    def run(self, on_status: Callable[[Status], None]) -> None:
        """Train to the end of the configuration, or until KeyboardInterrupt; either way the state is kept.

        Args:
            on_status: called every few hundred updates.
        """
        writer = SummaryWriter(str(self.folder / "tensorboard"))
        began, updates_before = time.perf_counter() - self._wall_s, self.updates
        started = time.perf_counter()
        next_log = self.updates
        try:
            while self.updates < self.config.updates:
                self._roll()
                self._wall_s = time.perf_counter() - began
                if len(self.replay) < self.config.warm_up:
                    continue
                for _ in range(self.config.updates_per_step):
                    self._metrics = self.learner.update(
                        self.replay.sample(self.config.qrsac.batch, self._replay_rng)
                    )
                    self.updates += 1
                    if self.updates % self.config.checkpoint_every == 0:
                        self._checkpoint(writer)
                if self.updates >= next_log:
                    next_log = self.updates + LOG_EVERY
                    rate = (self.updates - updates_before) / (time.perf_counter() - started)
                    status = self._status(rate)
                    self._log(writer, status)
                    on_status(status)
            self._save_state()
        except KeyboardInterrupt:
            self._save_state()
            raise
        finally:
            writer.close()

    def _roll(self) -> None:
        observation = np.concatenate([rollout.observation for rollout in self._rollouts])
        action = self.learner.act(observation, stochastic=True)
        steps, first = [], 0
        self._components = {}
        for rollout in self._rollouts:
            step, components = rollout.step(action[first : first + rollout.slots])
            steps.append(step)
            first += rollout.slots
            self._laps.extend(rollout.laps)
            self._off_course.append((rollout.off_course_s, rollout.driven_s))
            rollout.laps, rollout.off_course_s, rollout.driven_s = [], 0.0, 0.0
            for name, value in components.items():
                weight = rollout.slots / len(action)
                self._components[name] = self._components.get(name, 0.0) + weight * float(value.mean())
        joined = Step(*(np.concatenate(parts) for parts in zip(*steps, strict=True)))
        self.replay.add(observation, *joined)
        self.transitions += int(joined.valid.sum())

    def _status(self, rate: float) -> Status:
        off, driven = np.sum(self._off_course, axis=0)
        lap = float(np.mean(self._laps)) if self._laps else float("nan")
        return Status(self.updates, self.transitions, rate, lap, float(off / max(driven, 1e-9)))

    def _log(self, writer: SummaryWriter, status: Status) -> None:
        scalars: dict[str, Any] = {f"learner/{name}": float(value) for name, value in self._metrics.items()}
        scalars |= {f"reward/{name}": value for name, value in self._components.items()}
        scalars["training/off_course_share"] = status.off_course_share
        scalars["training/updates_per_s"] = status.updates_per_s
        if np.isfinite(status.lap_s):
            scalars["training/lap_s"] = status.lap_s
        for name, value in scalars.items():
            writer.add_scalar(name, value, self.updates)

    def _checkpoint(self, writer: SummaryWriter) -> None:
        config = self.config
        card = Card(
            algorithm="QR-SAC",
            hidden=config.qrsac.hidden,
            observation=self._spec,
            circuit=config.circuit,
            car=config.car,
            scenarios=tuple(rollouts.scenario for rollouts in config.rollouts),
            step=self.updates,
            transitions=self.transitions,
            seed=self.seed,
            created_by={"nathlon": version("nathlon"), "torch": version("torch")},
        )
        path = self.folder / "checkpoints" / f"step-{self.updates:07d}.safetensors"
        save_checkpoint(path, self.learner.policy_tensors(), card)
        self._save_state()
        laps = evaluate_laps(
            config.circuit,
            config.car,
            self._spec,
            lambda seen: self.learner.act(seen, stochastic=False),
            self.seed,
        )
        writer.add_scalar("evaluation/off_course_share", laps.off_course_share, self.updates)
        if np.isfinite(laps.lap_s):
            writer.add_scalar("evaluation/lap_s", laps.lap_s, self.updates)
        metrics = [f"{float(self._metrics[name]):.4f}" for name in ("mean_q", "entropy")]
        row = [self.updates, self.transitions, f"{self._wall_s:.0f}", f"{laps.lap_s:.3f}"]
        curve = self.folder / CURVE_FILE
        new = not curve.exists()
        with curve.open("a", newline="") as file:
            sheet = csv.writer(file)
            if new:
                sheet.writerow(CURVE)
            sheet.writerow([*row, f"{laps.off_course_share:.4f}", *metrics])

    def _save_state(self) -> None:
        counts = torch.tensor([self.updates, self.transitions, self._wall_s], dtype=torch.float64)
        path = self.folder / STATE_FILE
        partial = path.with_suffix(".partial")
        save_file({**self.learner.state_dict(), "counts": counts}, partial)
        os.replace(partial, path)


def _write_text(path: Path, text: str) -> None:
    partial = path.with_name(path.name + ".partial")
    partial.write_text(text, "utf-8")
    os.replace(partial, path)
