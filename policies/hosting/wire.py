"""Messages between processes that do not trust each other, and the end that answers them.

They are JSON and arrays of numbers, never pickles. This file needs numpy alone and runs in Python 3.7: hosts
of worlds in other interpreters load it by path.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from multiprocessing.connection import Connection
from threading import Thread
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from numpy.typing import NDArray

    Arrays = Mapping[str, NDArray[Any]]
    Message = tuple[dict[str, Any], dict[str, Any]]

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


def pipe_to_parent() -> Connection:
    """The pipe whose descriptor is the first argument; from now on this process ends with who asks."""
    end_after(sys.stdin.buffer.read)  # is closed with the parent, however that ends
    descriptor = int(sys.argv[1])
    os.set_inheritable(descriptor, False)
    return Connection(descriptor)


def messages(pipe: Connection) -> Iterator[Message]:
    """What is asked, with its arrays, until nobody asks any more."""
    while True:
        try:
            packed = pipe.recv_bytes()
        except EOFError:
            return
        yield unpack(packed)


def serve(pipe: Connection, answer: Callable[[dict[str, Any], dict[str, Any]], Message]) -> None:
    """Answer until nobody asks any more; what a question raises is said instead."""
    for message, arrays in messages(pipe):
        try:
            packed = pack(*answer(message, arrays))
        # It is foreign code: whatever it raises, the user wants to know whose it is.
        except Exception as error:
            packed = raised(error)
        pipe.send_bytes(packed)


def raised(error: BaseException) -> bytes:
    """A message that says what was raised, see `nathlon.policies.hosting.child.RaisedError`."""
    return pack({"raised": f"{type(error).__name__} ({error})"})


def end_after(wait: Callable[[], object]) -> None:
    """Leave Ctrl-C to the process that has started this one, and end with that one.

    All that this process has started ends with it, if it is the first of its group.

    Args:
        wait: returns when the other process has ended.
    """
    # Ctrl-C reaches the whole group; the process that started this one decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_after, args=(wait,), daemon=True).start()


def _end_after(wait: Callable[[], object]) -> None:
    wait()
    if os.name == "posix" and os.getpgrp() == os.getpid():
        os.killpg(0, signal.SIGKILL)
    os._exit(1)
