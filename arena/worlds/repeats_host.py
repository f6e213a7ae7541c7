"""The process in which a world plays once more: `python -m nathlon.arena.worlds.repeats_host DESCRIPTOR`."""

from __future__ import annotations

import sys
from dataclasses import asdict
from typing import Any

from nathlon.arena.worlds.repeats import play_here
from nathlon.policies.hosting.wire import pipe_to_parent, serve


def main() -> None:
    """Play what is asked for until nobody asks any more."""
    serve(pipe_to_parent(), _played)


def _played(wanted: dict[str, Any], _: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    sys.path[:] = wanted["path"]
    return {"played": [asdict(episode) for episode in play_here(wanted["world"], wanted["scenario"])]}, {}


if __name__ == "__main__":
    main()
