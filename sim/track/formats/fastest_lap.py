"""Circuits of fastest-lap: arrays of numbers along a centre line, in XML."""

from __future__ import annotations

from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.errors import InputError
from nathlon.sim.track.formats.markup import place, text_at
from nathlon.sim.track.formats.outline import CircuitLine, known_heights, to_numbers

EXPECTED = "expected <data> with <centerline> of <x> and <y>, and <nl> and <nr>"


def read_arrays(root: Element, text: str) -> CircuitLine:
    """Read a circuit with `format="discrete"`.

    With dimension 3 its y points south and its z down, as a comment in the file says.

    Args:
        root: of the file.
        text: the whole of it, for the comment.

    Raises:
        InputError: if arrays are missing or not equally long, or the circuit is open.
    """
    data = root.find("data")
    if data is None:
        raise InputError(f"{place(root)}: {EXPECTED}")
    if root.get("type", "closed") != "closed":
        raise InputError(f"{place(root)}: type is {root.get('type', '')[:40]!r}, expected a closed circuit")
    x, y = _array(data, "centerline/x"), _array(data, "centerline/y")
    upward = -1.0 if "y = -earth_radius" in text else 1.0
    right = left = None
    if data.find("nl") is not None:
        left, right = np.abs(_array(data, "nl")), np.abs(_array(data, "nr"))
    height = upward * _array(data, "centerline/z") if data.find("centerline/z") is not None else None
    for name, values in (("centerline/y", y), ("nl", left), ("nr", right), ("centerline/z", height)):
        if values is not None and len(values) != len(x):
            raise InputError(
                f"{place(data)}: {name} has {len(values)} numbers, expected {len(x)} as centerline/x"
            )
    return CircuitLine(
        "a circuit of fastest-lap",
        np.column_stack([x, upward * y]),
        [f"point {number}" for number in range(1, len(x) + 1)],
        right=right,
        left=left,
        height=None if height is None else known_heights(height),
        notes=("its y axis points south: turned over",) if upward < 0.0 else (),
    )


def _array(data: Element, path: str) -> NDArray[np.float64]:
    numbers = to_numbers(text_at(data, path), f"<{path}>")
    if not len(numbers):
        raise InputError(f"{place(data)}: no <{path}>, {EXPECTED}")
    return numbers
