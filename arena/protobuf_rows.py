"""Protobuf messages of one shape, written for all samples of a recording at once.

The library fills a message field by field, which for the samples of a race takes four times as long as all
the rest of writing it. It still reads every message. See https://protobuf.dev/programming-guides/encoding.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from google.protobuf.descriptor import FieldDescriptor
from numpy.typing import NDArray

Rows = NDArray[np.uint8]
"""(T, n): row t holds n bytes of message t."""
FIXED = {FieldDescriptor.TYPE_DOUBLE: "<f8", FieldDescriptor.TYPE_FLOAT: "<f4"}
SIGNED = (FieldDescriptor.TYPE_SINT32, FieldDescriptor.TYPE_SINT64)
"""Whose numbers are written zigzag: 0, -1, 1, -2, ..."""
VARINT, FIXED64, SIZED, FIXED32 = 0, 1, 2, 5
"""Wire types."""


def encode(message: Any, values: Mapping[str, Any], count: int) -> Rows:
    """Messages of one type, with the same fields in the same order.

    Args:
        message: the descriptor of their type.
        values: by field, (count,) numbers, a text that all have, values of a message within, or a list of
            these where the field is repeated.
        count: T, of messages.

    Raises:
        ValueError: for a negative number in a field that is not of a zigzag type, or one beyond 62 bits.
    """
    parts = [
        _field(field, one, count)
        for field in sorted(message.fields, key=lambda field: field.number)
        if field.name in values
        for one in _listed(values[field.name])
    ]
    return np.concatenate(parts, axis=1) if parts else np.zeros((count, 0), np.uint8)


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def _field(field: FieldDescriptor, value: Any, count: int) -> Rows:
    if isinstance(value, Mapping):
        return _sized(field, encode(field.message_type, value, count))
    if isinstance(value, str):
        return _sized(field, _alike(value.encode(), count))
    if field.type in FIXED:
        numbers = np.ascontiguousarray(value, FIXED[field.type])
        wire = FIXED64 if numbers.itemsize == 8 else FIXED32
        body = numbers.view(np.uint8).reshape(count, numbers.itemsize)
    else:
        wire, body = VARINT, _varints(np.asarray(value).astype(np.int64), field.type in SIGNED)
    return np.concatenate([_alike(_varint(field.number << 3 | wire), count), body], axis=1)


def _sized(field: FieldDescriptor, body: Rows) -> Rows:
    head = _varint(field.number << 3 | SIZED) + _varint(body.shape[1])
    return np.concatenate([_alike(head, len(body)), body], axis=1)


def _alike(content: bytes, count: int) -> Rows:
    return np.broadcast_to(np.frombuffer(content, np.uint8), (count, len(content)))


def _varint(number: int) -> bytes:
    return _varints(np.array([number]), zigzag=False).tobytes()


def _varints(numbers: NDArray[np.int64], zigzag: bool) -> Rows:
    """All as long as the longest: seven bits a byte, the lowest first, and a bit that says if more follow."""
    if zigzag:
        numbers = (numbers << 1) ^ (numbers >> 63)
    if numbers.min(initial=0) < 0:
        raise ValueError("a number is negative or beyond 62 bits")
    width = max(1, -(-int(numbers.max(initial=0)).bit_length() // 7))
    bits = (numbers[:, None] >> (7 * np.arange(width))) & 0x7F
    bits[:, :-1] |= 0x80
    return bits.astype(np.uint8)
