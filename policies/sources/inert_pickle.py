"""Pickles from others, read as data: arrays become arrays, a few known classes records, and nothing runs.

What a pickle names is never looked up: a name that is known stands for a record of what the pickle says of
it, any other one is refused. So even numpy's own functions are not called on what a file hands them.
"""

from __future__ import annotations

import io
import pickle
import pickletools
import re
from collections import OrderedDict
from functools import cache
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_BYTES = 1 << 26
"""Of a pickle, as of statistics of pictures with the last ones of all environments."""
MOST_OPCODES = 50_000
"""Some spaces and statistics have a few hundred; so many tuples inside one another do no harm."""

_KNOWN = re.compile(
    r"(numpy\.|numpy\._core\.|numpy\.core\.)(multiarray|numeric) (_reconstruct|scalar|_frombuffer)"
    r"|numpy (ndarray|dtype|bool_?|u?int(8|16|32|64)|float(16|32|64))"
    r"|numpy\.random\.\w+ \w+|numpy\.random\.bit_generator \w+"
    r"|numpy\.dtypes \w+DType"
    r"|stable_baselines3\.common\.vec_env\.vec_normalize VecNormalize"
    r"|stable_baselines3\.common\.running_mean_std RunningMeanStd"
    r"|(gym|gymnasium)\.spaces\.(space|box|discrete|multi_discrete|multi_binary|dict|tuple) \w+"
    r"|(gym|gymnasium)\.utils\.seeding RandomNumberGenerator"
    r"|_codecs encode|(copyreg|copy_reg) _reconstructor"
    r"|(builtins|__builtin__) (object|int|float|bool|str|bytes)"
)
_UNUSUAL = {"PERSID", "BINPERSID", "EXT1", "EXT2", "EXT4", "NEXT_BUFFER", "READONLY_BUFFER"}


class Record:
    """What a pickle says of an object: of which class, made with what, and in which state.

    Attributes:
        named: module and name of its class or of the function that makes it.
        arguments: that it is made with.
        state: its own, or None.
    """

    named = ""

    def __new__(cls, *arguments: Any, **_: Any) -> Record:
        """One that is made with these arguments, which it keeps."""
        record = super().__new__(cls)
        record.arguments = arguments
        record.state = None
        return record

    arguments: tuple[Any, ...]
    state: Any

    def __setstate__(self, state: Any) -> None:
        """Keep it."""
        # A state in two parts is that of attributes and of slots.
        both = isinstance(state, tuple) and len(state) == 2 and isinstance(state[0], dict | None)
        self.state = state[0] if both else state

    @property
    def fields(self) -> dict[str, Any]:
        """Its attributes by name; none if its state is something else."""
        state = self.state
        return (
            {key: value for key, value in state.items() if isinstance(key, str)}
            if isinstance(state, dict)
            else {}
        )


@cache
def _stand_in(module: str, name: str) -> type:
    if (module, name) == ("collections", "OrderedDict"):
        return OrderedDict
    named = f"{module} {name}"
    if not _KNOWN.fullmatch(named):
        raise pickle.UnpicklingError(f"names {module}.{name}")
    return type("Record", (Record,), {"named": named})


class _Reader(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        return _stand_in(module, name)


def read_pickle(content: bytes) -> Any:
    """What a pickle holds: numbers, texts, lists, tuples and dictionaries, arrays, and records.

    Raises:
        ValueError: if it is damaged, too long, or names what it need not; the file it does not name.
        MemoryError: if there is too little.
    """
    if len(content) > MOST_BYTES:
        raise ValueError(f"has {len(content)} bytes, expected at most {MOST_BYTES}")
    try:
        _check_opcodes(content)
        return _Reader(io.BytesIO(content)).load()
    except MemoryError:
        raise
    # A pickle that is damaged raises almost anything.
    except Exception as error:
        raise ValueError(str(error).partition("\n")[0] or type(error).__name__) from None


def _check_opcodes(content: bytes) -> None:
    for number, (opcode, argument, _) in enumerate(pickletools.genops(content)):
        if number >= MOST_OPCODES:
            raise ValueError(f"has more than {MOST_OPCODES} instructions")
        if opcode.name in _UNUSUAL:
            raise ValueError(f"has the instruction {opcode.name}")
        # Places in the memory for later use: room is made up to the highest.
        if opcode.name in ("PUT", "BINPUT", "LONG_BINPUT") and int(argument or 0) > MOST_OPCODES:
            raise ValueError(f"keeps something in place {argument}")


def array_of(value: Any) -> NDArray[Any]:
    """An array or a number as an array of numbers.

    Raises:
        ValueError: if it is none.
    """
    if isinstance(value, bool | int | float):
        return np.asarray(value)
    match value:
        case Record(arguments=(Record() as kind, data)) if value.named.endswith(" scalar"):
            return _array(_bytes(data), kind, (), "C")
        case Record(state=(_, tuple(shape), Record() as kind, bool() | int() as fortran, data)):
            return _array(_bytes(data), kind, shape, "F" if fortran else "C")
        case Record(arguments=(data, Record() as kind, tuple(shape), str(order))):
            return _array(_bytes(data), kind, shape, order)
    raise ValueError(f"has {_called(value)}, expected an array of numbers")


def dtype_of(record: Any) -> np.dtype[Any]:
    """The type of numbers that a record stands for.

    Raises:
        ValueError: if it is none.
    """
    match record:
        case Record(named="numpy dtype", arguments=(str(code), *_), state=state) if re.fullmatch(
            r"[biuf]\d{1,2}", code
        ):
            order = (
                state[1] if isinstance(state, tuple) and len(state) > 1 and state[1] in ("<", ">") else "|"
            )
            try:
                return np.dtype(f"{order}{code}")
            except TypeError:
                pass
        case type() if issubclass(record, Record) and record.named.startswith("numpy "):
            name = record.named.partition(" ")[2]
            if re.fullmatch(r"(bool|u?int|float)_?\d*", name):
                return np.dtype(name.rstrip("_"))
    raise ValueError(f"has {_called(record)}, expected a type of numbers")


def _bytes(value: Any) -> bytes:
    match value:
        case bytes() | bytearray():
            return bytes(value)
        # As protocols before 3 have it.
        case Record(named="_codecs encode", arguments=(str(text), "latin1")):
            return text.encode("latin1")
        case Record(named="__builtin__ bytes", arguments=()):
            return b""
    raise ValueError(f"has {_called(value)}, expected bytes")


def _array(data: bytes, kind: Record, shape: tuple[Any, ...], order: str) -> NDArray[Any]:
    dtype = dtype_of(kind)
    if not all(type(size) is int and size >= 0 for size in shape) or order not in ("C", "F"):
        raise ValueError("has an array of no shape")
    if len(shape) > 32 or prod(shape) * dtype.itemsize != len(data):
        raise ValueError(f"has an array of shape {shape} in {len(data)} bytes")
    array = np.frombuffer(data, dtype).reshape(shape, order=order)  # type: ignore[call-overload]
    return np.array(array, dtype.newbyteorder("="), order="C")


def _called(value: Any) -> str:
    if isinstance(value, Record):
        return value.named.replace(" ", ".")
    return type(value).__name__
