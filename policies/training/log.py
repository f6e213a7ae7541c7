"""What a training run leaves to look at: the curve of its checkpoints, and all scalars for TensorBoard."""

from __future__ import annotations

import csv
import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from torch import Tensor
from torch.utils.tensorboard import SummaryWriter

from nathlon.policies.training.evaluation import LapEvaluation
from nathlon.policies.training.stint import RolloutTally
from nathlon.sim.untrusted_file import read_text
from nathlon.sim.whole_file import write_whole, writing

CURVE_FILE = "curve.csv"
CURVE = ("updates", "transitions", "wall_s", "lap_s", "off_course_share", "mean_q", "entropy")
LATELY = 40


@dataclass(frozen=True)
class Status:
    """Where a run stands."""

    updates: int
    transitions: int
    updates_per_s: float
    lap_s: float  # mean of the last laps in training; nan before the first
    off_course_share: float  # in training, lately


class TrainingLog:
    """The log of one run; to be closed."""

    def __init__(self, folder: Path, updates: int) -> None:
        """A log that goes on with what the folder holds of a run that has come so far.

        A process that was killed may have added a row to the curve that its state knows nothing of; it goes.

        Raises:
            InputError: if the curve cannot be read or written.
        """
        self._curve = folder / CURVE_FILE
        if self._curve.exists():
            _cut(self._curve, updates)
        self._writer = SummaryWriter(str(folder / "tensorboard"))
        self._laps: deque[float] = deque(maxlen=LATELY)
        self._tally = RolloutTally()

    def close(self) -> None:
        """Write what is not written yet."""
        self._writer.close()

    def note(self, tally: RolloutTally) -> None:
        """Take in what happened in rollouts."""
        self._laps.extend(tally.laps)
        self._tally.add(tally)

    def progress(
        self, updates: int, transitions: int, updates_per_s: float, metrics: Mapping[str, Tensor]
    ) -> Status:
        """Write the scalars since the last call: learner's metrics, each component of the reward a step."""
        tally, self._tally = self._tally, RolloutTally()
        off_course = tally.off_course_s / max(tally.driven_s, 1e-9)
        lap_s = float(np.mean(self._laps)) if self._laps else math.nan
        scalars = {f"learner/{name}": float(value) for name, value in metrics.items()}
        scalars |= {f"reward/{name}": sum_ / max(tally.steps, 1) for name, sum_ in tally.components.items()}
        scalars["training/off_course_share"] = off_course
        scalars["training/updates_per_s"] = updates_per_s
        scalars["training/lap_s"] = lap_s
        self._write(scalars, updates)
        return Status(updates, transitions, updates_per_s, lap_s, off_course)

    def checkpoint(
        self,
        updates: int,
        transitions: int,
        wall_s: float,
        laps: LapEvaluation,
        metrics: Mapping[str, Tensor],
    ) -> None:
        """Add a row to the curve."""
        self._write(
            {"evaluation/off_course_share": laps.off_course_share, "evaluation/lap_s": laps.lap_s}, updates
        )
        new = not self._curve.exists()
        with self._curve.open("a", newline="") as file:
            sheet = csv.writer(file)
            if new:
                sheet.writerow(CURVE)
            row = [updates, transitions, f"{wall_s:.0f}", f"{laps.lap_s:.3f}", f"{laps.off_course_share:.4f}"]
            sheet.writerow(row + [f"{float(metrics[name]):.4f}" for name in ("mean_q", "entropy")])

    def _write(self, scalars: Mapping[str, float], updates: int) -> None:
        for name, value in scalars.items():
            if math.isfinite(value):
                self._writer.add_scalar(name, value, updates)


def _cut(curve: Path, updates: int) -> None:
    """Remove what a curve says of more updates than these."""
    lines = read_text(curve, "curve of a training run").splitlines(keepends=True)
    kept = [line for line in lines if not (at := line.split(",")[0]).isdecimal() or int(at) <= updates]
    if len(kept) == len(lines):
        return
    with writing(curve):
        write_whole(curve, "".join(kept))
