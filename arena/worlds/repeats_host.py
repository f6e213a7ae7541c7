"""The process in which a world plays once more: `python -m nathlon.arena.worlds.repeats_host DESCRIPTOR`."""

from __future__ import annotations

import os
import signal
import sys
import threading
from dataclasses import asdict
from multiprocessing.connection import Connection
from typing import Any

from nathlon.arena.worlds.repeats import play_here
from nathlon.sim.wire import pack, unpack


def main() -> None:
    """Play what is asked for until nobody asks any more."""
    # Ctrl-C is for the process that asks.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    pipe = Connection(int(sys.argv[1]))
    while True:
        try:
            wanted, _ = unpack(pipe.recv_bytes())
        except EOFError:
            return
        sys.path[:] = wanted["path"]
        try:
            played = play_here(wanted["world"], wanted["scenario"])
            answer: dict[str, Any] = {"played": [asdict(episode) for episode in played]}
        # It is foreign code: whatever it raises, the user wants to know whose it is.
        except Exception as error:
            answer = {"raised": f"{type(error).__name__} ({error})"}
        pipe.send_bytes(pack(answer))


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(1)


if __name__ == "__main__":
    main()
