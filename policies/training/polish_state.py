"""Where polishing stands, and how it is kept on disk."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from torch import Tensor

from nathlon.policies.training.log import CURVE_FILE
from nathlon.policies.training.state import COUNTS, STATE_FILE, take_counts, take_table, write_tensors
from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import open_regular
from nathlon.sim.whole_file import whole_file, writing

CURVE = ("rounds", "updates", "transitions", "reward", "lap_s", "off_course_share")
WEIGHTS, CURVE_KEY = "weights", "curve"


class PolishState(NamedTuple):
    """Where polishing stands.

    Attributes:
        rounds, updates, transitions: done so far.
        learner: what `Actor.tensors` gave.
        weights: (pairs,) of the draw of pairs.
        curve: (checkpoints, 6) what `CURVE` names.
    """

    rounds: int
    updates: int
    transitions: int
    learner: dict[str, Tensor]
    weights: NDArray[np.float64]
    curve: NDArray[np.float64]


def save_state(folder: Path, state: PolishState, facts: Mapping[str, str]) -> None:
    """Replace the state in a folder, and what it is the state of.

    Raises:
        InputError: if it cannot be written; the state that was there is left as it is.
    """
    own = {
        COUNTS: torch.tensor([state.rounds, state.updates, state.transitions]),
        WEIGHTS: torch.from_numpy(state.weights),
        CURVE_KEY: torch.from_numpy(state.curve),
    }
    write_tensors(folder / STATE_FILE, {**state.learner, **own}, dict(facts))


def load_state(folder: Path, facts: Mapping[str, str]) -> PolishState | None:
    """The state in a folder, which is made if it is not there; None if it holds none.

    Args:
        folder: of the polishing.
        facts: what it must be the state of.

    Raises:
        InputError: if the state cannot be read or is that of something else.
    """
    path = folder / STATE_FILE
    try:
        (folder / "checkpoints").mkdir(parents=True, exist_ok=True)
        if not path.exists():
            return None
        open_regular(path, "state of a polishing").close()
        with safe_open(path, framework="pt") as file:
            found = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
    except (OSError, SafetensorError) as error:
        raise InputError(f"{path}: not the state of a polishing: {error}") from None
    for name, value in facts.items():
        if found.get(name) != value:
            raise InputError(f"{path}: is of another {name}; choose another folder")
    rounds, updates, transitions = map(int, take_counts(path, tensors, 3))
    weights = take_table(path, tensors, WEIGHTS, (None,))
    curve = take_table(path, tensors, CURVE_KEY, (None, len(CURVE)))
    return PolishState(rounds, updates, transitions, tensors, weights, curve)


def write_curve(folder: Path, columns: Sequence[str], curve: NDArray[np.float64]) -> None:
    """Replace the curve (checkpoints, 6) in a folder, three counts and three figures each.

    Raises:
        InputError: if it cannot be written.
    """
    path = folder / CURVE_FILE
    with writing(path), whole_file(path) as partial, partial.open("w", newline="") as file:
        sheet = csv.writer(file)
        sheet.writerow(columns)
        for *counts, gain, lap_s, off_course in curve.tolist():
            figures = (f"{gain:.3f}", f"{lap_s:.3f}", f"{off_course:.4f}")
            sheet.writerow([*map(int, counts), *figures])
