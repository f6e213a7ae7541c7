"""The other end of a `nathlon.policies.child.Child`: a process that answers until nobody asks any more."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from multiprocessing.connection import Connection
from threading import Thread
from typing import Any

from nathlon.sim.wire import unpack


def pipe_to_parent() -> Connection:
    """The pipe whose descriptor is this process's argument; from now on it ends with the one that asks."""
    # Ctrl-C is for the process that asks.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()
    return Connection(int(sys.argv[1]))


def messages(pipe: Connection) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """What is asked, with its arrays, see `nathlon.sim.wire`, until nobody asks any more."""
    while True:
        try:
            packed = pipe.recv_bytes()
        except EOFError:
            return
        yield unpack(packed)


def _end_with_parent() -> None:
    sys.stdin.buffer.read()  # is closed with the parent, however that ends
    os._exit(1)
