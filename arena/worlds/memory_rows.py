"""Memories of any arrays as rows of numbers: races keep one row a car, and hand it over with the car."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.general.outputs import IllegalActionError
from nathlon.policies.policy import Batch


class MemoryRows:
    """How memories that are made like one fit into rows: one number for each of their bytes.

    So the numbers of all types come back to the bit, and a row of zeros stands for no memory yet.
    """

    def __init__(self, example: Any) -> None:
        """Of a memory: arrays of any library, numbers and None, in tuples, lists and dictionaries.

        Raises:
            IllegalActionError: if it holds anything else.
        """
        self._example = example
        self._shapes = [(one.shape, one.dtype) for one in _leaves(example)]
        self.size = 1 + sum(one.nbytes for one in _leaves(example))

    def row(self, memory: Any) -> NDArray[np.float32]:
        """A memory as (size,) float32.

        Raises:
            IllegalActionError: if it is made otherwise.
        """
        leaves = list(_leaves(memory))
        shapes = [(one.shape, one.dtype) for one in leaves]
        if shapes != self._shapes:
            raise IllegalActionError(
                f"memory has {shapes}, expected {self._shapes} as after the first step: "
                "arrays of the same shapes at every step"
            )
        content = b"".join([b"\1", *(one.tobytes() for one in leaves)])
        return np.frombuffer(content, np.uint8).astype(np.float32)

    def memory(self, row: NDArray[np.float32]) -> Any:
        """The memory in a row; None before the first step."""
        if not row[0]:
            return None
        content = row[1:].astype(np.uint8).tobytes()
        arrays, place = [], 0
        for shape, dtype in self._shapes:
            size = int(np.prod(shape)) * dtype.itemsize
            arrays.append(np.frombuffer(content[place : place + size], dtype).reshape(shape).copy())
            place += size
        return _rebuilt(self._example, iter(arrays))

    def blank(self, n: int) -> Batch:
        """Rows of n cars that have not been asked yet, (n, size) float32."""
        return np.zeros((n, self.size), np.float32)


def _leaves(value: Any) -> Iterator[NDArray[Any]]:
    """The arrays of a memory, in their order."""
    if value is None:
        return
    if isinstance(value, Mapping):
        for one in value.values():
            yield from _leaves(one)
    elif isinstance(value, tuple | list):
        for one in value:
            yield from _leaves(one)
    else:
        array = np.asarray(value.detach().cpu() if hasattr(value, "detach") else value)
        if array.dtype.kind not in "biufc":
            raise IllegalActionError(
                f"memory holds {type(value).__name__}, "
                "expected arrays and numbers, in tuples, lists and dictionaries"
            )
        yield array


def _rebuilt(example: Any, arrays: Iterator[NDArray[Any]]) -> Any:
    """A memory made like an example, of other arrays."""
    if example is None:
        return None
    if isinstance(example, Mapping):
        return {key: _rebuilt(one, arrays) for key, one in example.items()}
    if isinstance(example, tuple) and hasattr(example, "_fields"):
        return type(example)(*(_rebuilt(one, arrays) for one in example))
    if isinstance(example, tuple | list):
        return type(example)(_rebuilt(one, arrays) for one in example)
    array = next(arrays)
    if isinstance(example, bool | int | float):
        return array.item()
    torch: Any = sys.modules.get("torch")
    return torch.from_numpy(array) if torch and isinstance(example, torch.Tensor) else array
