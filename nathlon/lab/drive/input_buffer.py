"""Where what a person does arrives, and waits for the next step of the world."""

from __future__ import annotations

import math
import struct
import threading
from typing import NamedTuple

from nathlon.lab.drive.aids import IDLE, Controls

INPUT = struct.Struct("<IB3xfff")
"""A frame of inputs: sequence number, whether with keys, steering, throttle, brake."""


class Noted(NamedTuple):
    """Controls as they arrived.

    Attributes:
        number: in the page's count; later ones are greater.
        controls: what the person did.
    """

    number: int
    controls: Controls


class InputBuffer:
    """The latest controls; written by the server, read by the world's thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.clear()

    def clear(self) -> None:
        """Forget what has come: the page counts anew."""
        with self._lock:
            self._latest = Noted(0, IDLE)

    def put(self, frame: bytes) -> None:
        """Note a frame of inputs, unless a later one has come before.

        Raises:
            ValueError: if it is no such frame.
        """
        if len(frame) != INPUT.size:
            raise ValueError(f"a frame of inputs has {len(frame)} bytes, expected {INPUT.size}")
        number, keys, *values = INPUT.unpack(frame)
        if not all(map(math.isfinite, values)):
            raise ValueError("a frame of inputs is not finite, expected numbers")
        steering, throttle, brake = values
        controls = Controls(
            bool(keys),
            min(max(steering, -1.0), 1.0),
            min(max(throttle, 0.0), 1.0),
            min(max(brake, 0.0), 1.0),
        )
        with self._lock:
            if number > self._latest.number:
                self._latest = Noted(number, controls)

    @property
    def latest(self) -> Noted:
        """What has come last."""
        with self._lock:
            return self._latest
