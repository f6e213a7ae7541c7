"""Messages between processes that do not trust each other: JSON and arrays of numbers, never pickles.

It needs numpy alone and runs in Python 3.7: hosts of worlds in other interpreters load this file by path.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Arrays = Mapping[str, NDArray[Any]]

KINDS = "biuf"
"""Kinds of numpy's dtypes that arrays may have: numbers that lie in memory as they are."""


def pack(message: Mapping[str, Any], arrays: Arrays | None = None) -> bytes:
    """A message as bytes.

    Args:
        message: what JSON can hold.
        arrays: by name, of any shape; of numbers only.
    """
    parts = {name: np.asarray(array, order="C") for name, array in (arrays or {}).items()}
    shapes = {name: [array.dtype.str, list(array.shape)] for name, array in parts.items()}
    header = json.dumps({"message": dict(message), "arrays": shapes}).encode()
    return b"".join([len(header).to_bytes(4, "little"), header, *(part.tobytes() for part in parts.values())])


def unpack(data: bytes) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Message and arrays from bytes; the arrays are read-only.

    Raises:
        ValueError: if the bytes are no message.
    """
    end = 4 + int.from_bytes(data[:4], "little")
    try:
        header = json.loads(data[4:end])
        message, shapes = dict(header["message"]), dict(header["arrays"])
        arrays = {}
        for name, (kind, shape) in shapes.items():
            dtype = np.dtype(str(kind))
            if dtype.kind not in KINDS or min(shape, default=0) < 0:
                raise ValueError(f"array {name} is {shape} of {dtype}, expected numbers")
            count = int(np.prod(shape, dtype=np.int64))
            arrays[name] = np.frombuffer(data, dtype, count, end).reshape(shape)
            end += arrays[name].nbytes
    except (KeyError, TypeError, OverflowError, RecursionError) as error:
        raise ValueError(f"no message: {error}") from None
    if end != len(data):
        raise ValueError(f"{len(data) - end} bytes too many")
    return message, arrays
