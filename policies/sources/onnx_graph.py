"""ONNX graphs from others, run by onnxruntime on one thread: the same observations give the same answers.

What they are is checked as data before, see `nathlon.policies.sources.onnx_model`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.policy import Batch
from nathlon.policies.sources.foreign import ForeignCard
from nathlon.policies.sources.onnx_states import Told, find_states, without_state
from nathlon.sim.errors import InputError

if TYPE_CHECKING:
    from gymnasium.spaces import Space

_NUMBERS: dict[str, type[np.generic]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(double)": np.float64,
    "tensor(uint8)": np.uint8,
    "tensor(int32)": np.int32,
    "tensor(int64)": np.int64,
}
"""Types of inputs."""


@dataclass(frozen=True)
class Input:
    """One of the arrays that a graph takes.

    Attributes:
        name: in the graph.
        at: where it lies in a flat observation.
        shape: without the batch.
        kind: its type of numbers.
        counts: whether it is the number of a choice that the flat observation has as one of many.
    """

    name: str
    at: slice
    shape: tuple[int, ...]
    kind: type[np.generic]
    counts: bool = False

    def __call__(self, observations: Batch) -> NDArray[Any]:
        """It, (n, *shape), of flat observations."""
        part = observations[:, self.at]
        array = part.argmax(axis=1) if self.counts else part
        return np.ascontiguousarray(array.reshape(len(part), *self.shape), self.kind)


class OnnxGraph:
    """A graph that takes flat observations.

    Attributes:
        path: its file, for errors.
        size: numbers of an observation.
        shape: of the one array that it takes; None if there are several.
        remembers: numbers that it keeps from one step to the next.
    """

    def __init__(self, session: Any, path: Path, card: ForeignCard, seen: Space[Any] | None = None) -> None:
        """The graph of an `onnxruntime.InferenceSession`.

        Args:
            session: which runs it.
            path: its file.
            card: which may name the output that is the actions, and states.
            seen: space of the observations; None for one row of numbers.

        Raises:
            InputError: if it takes anything else.
        """
        self.path = path
        self._session = session
        parts: Any = getattr(seen, "spaces", {})
        keys = parts.keys() if isinstance(parts, dict) else ()
        inputs, outputs = _told(session.get_inputs()), _told(session.get_outputs())
        self._states = find_states(path, inputs, outputs, card.states, keys)
        taken = {state.taken for state in self._states}
        self._inputs, self._alone = _inputs(path, [each for each in inputs if each[0] not in taken], seen)
        self._alone = self._alone or any(state.axis is None for state in self._states)
        self.remembers = self._states[-1].at.stop if self._states else 0
        first, *others = self._inputs
        self.size = _size(seen) if seen is not None and others else prod(first.shape)
        self.shape = None if others else first.shape
        given = {state.given for state in self._states}
        self._outputs = [name for name, _, _ in outputs if name not in given]
        self._wanted = card.output

    def initial_memory(self, n: int) -> Batch:
        """States of zeros, (n, remembers) float32."""
        return np.zeros((n, self.remembers), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[NDArray[Any], Batch]:
        """What it gives for observations (n, size) float32, see `probe`, and memory (n, m) float32 after."""
        with _memory_errors():
            [found], memory = self._run(observations, memory, self._outputs)
        return found, memory

    def _run(self, observations: Batch, memory: Batch, names: list[str]) -> tuple[list[Any], Batch]:
        """Some outputs, and the memory after; row by row where the graph takes one at a time."""
        if not self._alone:
            return self._once(observations, memory, names)
        rows = [
            self._once(row[None], own[None], names) for row, own in zip(observations, memory, strict=True)
        ]
        columns = zip(*(found for found, _ in rows), strict=True)
        together = [np.concatenate([_first(one) for one in column]) for column in columns]
        return together, np.concatenate([after for _, after in rows])

    def _once(self, observations: Batch, memory: Batch, names: list[str]) -> tuple[list[Any], Batch]:
        fed = {each.name: each(observations) for each in self._inputs}
        fed |= {state.taken: state.unpacked(memory) for state in self._states}
        found = self._session.run([*names, *(state.given for state in self._states)], fed)
        kept = [
            state.packed(self.path, array, len(observations))
            for state, array in zip(self._states, found[len(names) :], strict=True)
        ]
        after = np.concatenate(kept, axis=1) if kept else memory
        return [_plain(each) for each in found[: len(names)]], after

    def probe(self, answer: Callable[[NDArray[Any], int], NDArray]) -> NDArray:
        """What it answers to some observations; from now on it gives the output that is the actions.

        Args:
            answer: checks what the graph gave for a number of observations.

        Raises:
            InputError: if it fails on them, or answers otherwise when asked again.
        """
        observations = np.random.default_rng(0).standard_normal((3, self.size)).astype(np.float32)
        found = self._attempt(observations)
        self._outputs = [self._outputs[self._actions(found, len(observations))]]
        first, again = (answer(self._attempt(observations)[0], 3) for _ in range(2))
        if first.tobytes() != again.tobytes():
            raise InputError(
                f"{self.path}: gives other actions for the same observations, expected the same ones"
            )
        return first

    def _actions(self, found: list[Any], n: int) -> int:
        """Which of the outputs is the actions: the one that the card names, or the only one that may be."""
        names = self._outputs
        if self._wanted is not None:
            if self._wanted in names:
                return names.index(self._wanted)
            raise InputError(f"{self.path}: has no output {self._wanted!r}, expected {', '.join(names)}")
        if len(found) == 1:
            return 0
        if len(called := [index for index, name in enumerate(names) if "action" in name.lower()]) == 1:
            return called[0]
        # As Stable-Baselines3's documentation exports it: actions, value and logarithm of the probability.
        if len(found) == 3 and [getattr(one, "shape", ()) for one in found[1:]] == [(n, 1), (n,)]:
            return 0
        raise InputError(
            f"{self.path}: outputs are {', '.join(map(repr, names))}, expected one, or a card whose field "
            "'output' names the one of the actions"
        )

    def _attempt(self, observations: Batch) -> list[Any]:
        try:
            with _memory_errors():
                found, _ = self._run(observations, self.initial_memory(len(observations)), self._outputs)
                return found
        except (MemoryError, InputError):
            raise
        except Exception as error:
            raise InputError(
                f"{self.path}: fails on {len(observations)} observations ({_first_line(error)})"
            ) from None


def _plain(found: Any) -> Any:
    """Numbers of any precision as float32, or int64."""
    if isinstance(found, np.ndarray) and found.dtype in (np.float16, np.float64):
        return found.astype(np.float32)
    return found.astype(np.int64) if isinstance(found, np.ndarray) and found.dtype == np.int32 else found


def _first(found: NDArray[Any]) -> NDArray[Any]:
    """What a graph gave for one observation, with a batch of it."""
    return found if found.ndim and len(found) == 1 else found.reshape(1, -1)


def shapes(found: list[Any]) -> list[tuple[str, tuple[int, ...]]]:
    """Type and shape of each array of what a graph gave."""
    return [(str(each.dtype), each.shape) for each in found if isinstance(each, np.ndarray)]


def open_session(path: Path, content: bytes) -> Any:
    """An `onnxruntime.InferenceSession` of the graph in a file with these bytes.

    Raises:
        InputError: if onnxruntime cannot run it.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.use_deterministic_compute = True
    options.log_severity_level = 4
    # Else it might take the bytes for its own format, in which nothing was checked.
    options.add_session_config_entry("session.load_model_format", "ONNX")
    try:
        with _memory_errors():
            return onnxruntime.InferenceSession(content, options, ["CPUExecutionProvider"])
    except MemoryError:
        raise
    # Its other errors have no class in common.
    except Exception as error:
        raise InputError(f"{path}: onnxruntime cannot run the graph ({_first_line(error)})") from None


@contextmanager
def _memory_errors() -> Iterator[None]:
    """Raise as a MemoryError what onnxruntime calls otherwise."""
    try:
        yield
    except Exception as error:
        if "Failed to allocate memory" in str(error):
            raise MemoryError(_first_line(error)) from None
        raise


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0]


def _size(space: Space[Any]) -> int:
    """Numbers of a flat observation."""
    from gymnasium.spaces import flatdim  # takes long to load

    return flatdim(space)


def _told(arrays: Any) -> list[Told]:
    """Inputs or outputs of a session."""
    return [(each.name, each.type, list(each.shape)) for each in arrays]


def _inputs(path: Path, told: list[Told], seen: Space[Any] | None) -> tuple[tuple[Input, ...], bool]:
    """The arrays of an observation that a graph takes, and whether it takes one observation at a time."""
    from gymnasium.spaces import Dict, Discrete, flatdim

    found = ", ".join(f"{name} {kind} {shape}" for name, kind, shape in told) or "none"
    inner = seen.spaces if isinstance(seen, Dict) else {}
    if not told or (len(told) > 1 and not {name for name, _, _ in told} <= inner.keys()):
        raise without_state(path, found, inner.keys())
    starts = dict(zip(inner, np.cumsum([0, *map(flatdim, inner.values())]), strict=False))
    inputs: list[Input] = []
    for name, kind, batch in told:
        shape = batch[1:]
        if kind not in _NUMBERS or not batch or not all(type(size) is int and size > 0 for size in shape):
            raise InputError(f"{path}: inputs are {found}; expected one, tensor(float) ['n', observations]")
        if isinstance(batch[0], int) and batch[0] != 1:
            raise InputError(
                f"{path}: takes {batch[0]} observations at once, expected any number or 1: export it with a "
                "dynamic batch, or for one observation"
            )
        size, counts = prod(shape), False
        if len(told) > 1:
            space = inner[name]
            counts = isinstance(space, Discrete) and size == 1
            if size != flatdim(space) and not counts:
                raise InputError(f"{path}: input {name!r} takes {size} numbers, expected {flatdim(space)}")
            size = flatdim(space)
        at = int(starts[name]) if len(told) > 1 else 0
        inputs.append(Input(name, slice(at, at + size), tuple(shape), _NUMBERS[kind], counts))
    return tuple(inputs), any(isinstance(shape[0], int) for _, _, shape in told)
