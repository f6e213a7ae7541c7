"""The process in which a world plays once more: `python -m nathlon.arena.worlds.repeats_host DESCRIPTOR`."""

from __future__ import annotations

import sys
from dataclasses import asdict
from typing import Any

from nathlon.arena.worlds.repeats import play_here
from nathlon.policies.child_host import messages, pipe_to_parent
from nathlon.sim.wire import pack


def main() -> None:
    """Play what is asked for until nobody asks any more."""
    pipe = pipe_to_parent()
    for wanted, _ in messages(pipe):
        sys.path[:] = wanted["path"]
        try:
            played = play_here(wanted["world"], wanted["scenario"])
            answer: dict[str, Any] = {"played": [asdict(episode) for episode in played]}
        # It is foreign code: whatever it raises, the user wants to know whose it is.
        except Exception as error:
            answer = {"raised": f"{type(error).__name__} ({error})"}
        pipe.send_bytes(pack(answer))


if __name__ == "__main__":
    main()
