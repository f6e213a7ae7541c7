"""The state of a training run on disk: all that going on after a stop needs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.torch import load_file, save_file
from torch import Tensor

from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import open_regular
from nathlon.sim.whole_file import whole_file

STATE_FILE = "state.safetensors"
REPLAY_FILE = "replay.safetensors"
RANDOM_KEY = "replay_rng"
COUNTS = "counts"


class RunState(NamedTuple):
    """Where a run stands.

    Attributes:
        updates, transitions, wall_s: how far it has come, and in how many seconds.
        learner: the learner's `state_dict`.
        rng: state of the generator that samples the replay tables.
    """

    updates: int
    transitions: int
    wall_s: float
    learner: dict[str, Tensor]
    rng: dict


def save_state(folder: Path, state: RunState) -> None:
    """Replace the state in a run's folder.

    Raises:
        InputError: if it cannot be written; the state that was there is left as it is.
    """
    counts = torch.tensor([state.updates, state.transitions, state.wall_s], dtype=torch.float64)
    tensors = {**state.learner, COUNTS: counts}
    write_tensors(folder / STATE_FILE, tensors, {RANDOM_KEY: json.dumps(state.rng)})


def load_state(folder: Path) -> RunState:
    """The state in a run's folder.

    Raises:
        InputError: if it cannot be read.
    """
    path = folder / STATE_FILE
    tensors = read_tensors(path)
    updates, transitions, wall_s = take_counts(path, tensors, 3)
    with safe_open(path, framework="pt") as file:
        text = (file.metadata() or {}).get(RANDOM_KEY, "")
    try:
        rng = json.loads(text)
        np.random.default_rng().bit_generator.state = rng
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        raise InputError(f"{path}: {RANDOM_KEY}: expected the state of a random generator") from None
    return RunState(int(updates), int(transitions), wall_s, tensors, rng)


def take_table(
    path: Path, tensors: dict[str, Tensor], name: str, shape: tuple[int | None, ...]
) -> NDArray[np.float64]:
    """A table of numbers, taken out of the tensors of a file.

    Args:
        path: of the file, for the error.
        tensors: by name.
        name: of the table.
        shape: that it must have, with None for any size.

    Raises:
        InputError: if it is missing, or has another shape.
    """
    tensor = tensors.pop(name, None)
    if tensor is None:
        raise InputError(f"{path}: tensor {name!r} is missing")
    found = tuple(tensor.shape)
    if len(found) != len(shape) or any(
        size not in (own, None) for own, size in zip(found, shape, strict=True)
    ):
        expected = ", ".join("any" if size is None else str(size) for size in shape)
        raise InputError(f"{path}: tensor {name!r} has shape {found}, expected ({expected})")
    return tensor.double().numpy()


def take_counts(path: Path, tensors: dict[str, Tensor], n: int) -> list[float]:
    """What a run has counted, n numbers, taken out of the tensors of its state.

    Raises:
        InputError: if they are missing, negative or not finite.
    """
    counts = take_table(path, tensors, COUNTS, (n,))
    if not (np.isfinite(counts) & (counts >= 0.0)).all():
        raise InputError(f"{path}: tensor {COUNTS!r} is {counts.tolist()}, expected numbers from 0 up")
    return list(counts.tolist())


def write_tensors(path: Path, tensors: dict[str, Tensor], metadata: dict[str, str] | None = None) -> None:
    """Replace a safetensors file.

    Raises:
        InputError: if it cannot be written; the file that was there is left as it is.
    """
    try:
        with whole_file(path) as partial:
            save_file(tensors, partial, metadata)
    except (OSError, SafetensorError) as error:
        raise InputError(f"{path}: cannot be written: {error}") from None


def read_tensors(path: Path) -> dict[str, Tensor]:
    """The tensors of a safetensors file.

    Raises:
        InputError: if it cannot be read.
    """
    open_regular(path, "state of a training run").close()
    try:
        return load_file(path)
    except (OSError, SafetensorError) as error:
        raise InputError(f"{path}: not the state of a training run: {error}") from None
