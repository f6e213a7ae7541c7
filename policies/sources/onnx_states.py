"""What a graph remembers: arrays that it takes, and gives again for the next step."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.policy import Batch
from nathlon.sim.errors import InputError

MOST_NUMBERS = 1 << 20
"""Of all states of a policy together."""
_NUMBERS: dict[str, type[np.floating[Any]]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(double)": np.float64,
}
_BEFORE, _AFTER = {"in", "input", "prev", "previous", "last", "old"}, {"out", "output", "next", "new"}
"""Words in names of what is taken and of what is given."""
_NO_STATE = ("obs", "action")
"""What such words never begin with."""
_CARD = "a card whose field 'states' has the output of each such input"

Told = tuple[str, str, list[Any]]
"""Name, type and shape of an input or output; a size that is no number may be any."""


@dataclass(frozen=True)
class RecurrentState:
    """One of these arrays.

    Attributes:
        taken, given: its names before and after a step.
        shape: its own, without the batch.
        axis: where the batch is; None where the graph has none.
        kind: its type of numbers.
        at: where it lies in the memory of a policy.
    """

    taken: str
    given: str
    shape: tuple[int, ...]
    axis: int | None
    kind: type[np.floating[Any]]
    at: slice

    def unpacked(self, memory: Batch) -> NDArray[Any]:
        """It, as the graph takes it, of memory (n, m) float32."""
        array = memory[:, self.at].reshape(len(memory), *self.shape)
        array = array[0] if self.axis is None else np.moveaxis(array, 0, self.axis)
        return np.ascontiguousarray(array, self.kind)

    def packed(self, path: Path, array: Any, n: int) -> Batch:
        """Its numbers (n, k) float32, of what the graph gave for n observations.

        Raises:
            InputError: if that has another shape than what the graph took.
        """
        expected = list(self.shape)
        if self.axis is not None:
            expected.insert(self.axis, n)
        if not isinstance(array, np.ndarray) or array.shape != tuple(expected):
            found = getattr(array, "shape", type(array).__name__)
            raise InputError(
                f"{path}: output {self.given!r} is {found}, expected {tuple(expected)} as {self.taken!r}"
            )
        rows = array if self.axis is None else np.moveaxis(array, self.axis, 0)
        return np.ascontiguousarray(rows.reshape(n, -1), np.float32)


def find_states(
    path: Path,
    inputs: Sequence[Told],
    outputs: Sequence[Told],
    named: Mapping[str, str],
    observed: Collection[str],
) -> tuple[RecurrentState, ...]:
    """The states of a graph: those that its card names, or else inputs and outputs that are called alike.

    Args:
        path: of its file.
        inputs, outputs: of the graph.
        named: outputs by inputs, as a card names them.
        observed: names of inputs that are parts of the observation.

    Raises:
        InputError: if a state of the card is none, one cannot be told, or they have too many numbers.
    """
    pairs = dict(named)
    if not pairs and len(inputs) > 1:
        given = {name: _key(name, _AFTER) for name, _, _ in outputs}
        for name, _, _ in inputs:
            own = _key(name, _BEFORE)
            same = [other for other, key in given.items() if own and key == own]
            if name not in observed and len(same) == 1 and same[0] not in pairs.values():
                pairs[name] = same[0]
    known, there = {each[0]: each for each in inputs}, {each[0] for each in outputs}
    states: list[RecurrentState] = []
    place = 0
    for taken, after in pairs.items():
        if taken not in known or after not in there:
            raise InputError(
                f"{path}: card has the state {taken!r}: {after!r}, expected an input, of "
                f"{', '.join(known)}, and an output, of {', '.join(sorted(there))}"
            )
        state = _state(path, known[taken], after, place)
        states.append(state)
        place = state.at.stop
    if place > MOST_NUMBERS:
        raise InputError(f"{path}: has states of {place} numbers, expected at most {MOST_NUMBERS}")
    return tuple(states)


def without_state(path: Path, found: str, keys: Collection[str]) -> InputError:
    """The refusal of a graph with an input that is neither an observation nor a state."""
    parts = f", or one for each of {', '.join(keys)}" if keys else ""
    return InputError(
        f"{path}: inputs are {found}; expected one, tensor(float) ['n', observations]{parts}; beside it "
        f"states, with names such as h_in and h_out, or {_CARD}"
    )


def _state(path: Path, told: Told, after: str, place: int) -> RecurrentState:
    name, kind, sizes = told
    free = [axis for axis, size in enumerate(sizes) if type(size) is not int]
    fixed = [size for size in sizes if type(size) is int]
    if kind not in _NUMBERS or len(free) > 1 or any(size < 1 for size in fixed):
        raise InputError(
            f"{path}: state {name!r} is {kind} {sizes}, expected numbers with a point, and all sizes fixed "
            "but that of the batch"
        )
    at = slice(place, place + prod(fixed))
    return RecurrentState(name, after, tuple(fixed), free[0] if free else None, _NUMBERS[kind], at)


def _key(name: str, words: Collection[str]) -> tuple[str, ...]:
    """What a name says besides whether it is before or after; () where it cannot be a state's.

    PyTorch calls them `h0` and `hn`.
    """
    end = "0" if words is _BEFORE else "n"
    plain = re.sub(rf"(?<![a-z])([a-z]){end}$", r"\1", name.lower())
    parts = tuple(part for part in re.split(r"[^a-z0-9]+", plain) if part and part not in words)
    return () if any(part.startswith(_NO_STATE) for part in parts) else parts
