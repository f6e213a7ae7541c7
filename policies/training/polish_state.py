"""Where polishing stands, and how it is kept on disk."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open

from policies.training.evaluation import LapEvaluation
from policies.training.log import CURVE_FILE
from policies.training.state import STATE_FILE, write_tensors
from sim.errors import InputError
from sim.whole_file import whole_file

CURVE = ("rounds", "reward", "lap_s", "off_course_share")
DECAY = (0.9, 0.99)
"""Of Adam's mean and mean square."""
EPSILON = 1e-8

Array = NDArray[np.float64]


class PolishState(NamedTuple):
    """Where polishing stands.

    Attributes:
        rounds: done so far, (1,).
        change: of the last layer's weights so far, (units, actions).
        mean, square: Adam's moments of its direction, of the same shape.
        curve: (checkpoints, 4) what `CURVE` names.
    """

    rounds: NDArray[np.int64]
    change: Array
    mean: Array
    square: Array
    curve: Array

    @classmethod
    def initial(cls, shape: tuple[int, ...]) -> PolishState:
        """At the beginning, for weights of a shape."""
        change, mean, square = np.zeros((3, *shape))
        return cls(np.zeros(1, np.int64), change, mean, square, np.zeros((0, len(CURVE))))

    def moved(self, direction: Array, step: Array) -> PolishState:
        """After a step of Adam in a direction (units, actions), of so much for each action."""
        first, second = DECAY
        rounds = self.rounds + 1
        mean = first * self.mean + (1.0 - first) * direction
        square = second * self.square + (1.0 - second) * direction**2
        scale = np.sqrt(square / (1.0 - second**rounds)) + EPSILON
        change = self.change + step * mean / (1.0 - first**rounds) / scale
        return PolishState(rounds, change, mean, square, self.curve)

    def noted(self, reward: float, laps: LapEvaluation) -> PolishState:
        """With another row of the curve."""
        row = [[float(self.rounds[0]), reward, laps.lap_s, laps.off_course_share]]
        return self._replace(curve=np.concatenate([self.curve, row]))


def save_state(folder: Path, state: PolishState, facts: Mapping[str, str]) -> None:
    """Replace the state in a folder, and what it is the state of.

    Raises:
        InputError: if it cannot be written; the state that was there is left as it is.
    """
    tensors = {name: torch.from_numpy(array) for name, array in state._asdict().items()}
    write_tensors(folder / STATE_FILE, tensors, dict(facts))


def load_state(folder: Path, facts: Mapping[str, str], shape: tuple[int, ...]) -> PolishState | None:
    """The state in a folder, which is made if it is not there; None if it holds none.

    Args:
        folder: of the polishing.
        facts: what it must be the state of.
        shape: of the weights.

    Raises:
        InputError: if the state cannot be read or is that of something else.
    """
    path = folder / STATE_FILE
    try:
        (folder / "checkpoints").mkdir(parents=True, exist_ok=True)
        if not path.exists():
            return None
        with safe_open(path, framework="numpy") as file:
            found = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
    except (OSError, SafetensorError) as error:
        raise InputError(f"{path}: not the state of a polishing: {error}") from None
    for name, value in facts.items():
        if found.get(name) != value:
            raise InputError(f"{path}: is of another {name}; choose another folder")
    initial = PolishState.initial(shape)
    for name, tensor in initial._asdict().items():
        if name not in tensors or tensors[name].shape[1:] != tensor.shape[1:]:
            raise InputError(f"{path}: tensor {name!r} is missing or of another shape")
    return PolishState(**{name: tensors[name] for name in PolishState._fields})


def write_curve(folder: Path, state: PolishState) -> None:
    """Replace the curve in a folder.

    Raises:
        InputError: if it cannot be written.
    """
    path = folder / CURVE_FILE
    try:
        with whole_file(path) as partial, partial.open("w", newline="") as file:
            sheet = csv.writer(file)
            sheet.writerow(CURVE)
            for rounds, reward, lap_s, off_course in state.curve.tolist():
                sheet.writerow([int(rounds), f"{reward:.3f}", f"{lap_s:.3f}", f"{off_course:.4f}"])
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
