"""What a policy in a seat raises is laid to it: where it goes on, and where its process ends."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box

from nathlon.arena.watch import NOBODY, Watch
from nathlon.arena.worlds.player import Asking

SPACE = Box(-1.0, 1.0, (1,), np.float32)


def ask(raised: BaseException, watch: Watch) -> Asking:
    """Ask a policy that raises, as entrant 1 of match 3."""

    def act(seen: Any, memory: Any) -> Any:
        raise raised

    policy = SimpleNamespace(precise=False, initial_memory=lambda n: np.zeros((n, 0)), act=act)
    player = Asking(policy, "seat", SPACE, SPACE, np.random.default_rng(0), 0, 60.0)
    player.watched(watch, 3, 1).act(np.zeros(1, np.float32))
    return player


class Panic(BaseException):
    """As those of extensions written in Rust, and cancelled tasks, are no Exception."""


@pytest.mark.parametrize("raised", [Panic(), GeneratorExit(), KeyboardInterrupt(), MemoryError()])
def test_what_ends_the_process_leaves_the_watch_at_whom_was_asked(raised: BaseException) -> None:
    watch = Watch()
    with pytest.raises(type(raised)):
        ask(raised, watch)
    assert watch.asked[1:3] == (3, 1)


@pytest.mark.parametrize("raised", [ValueError(), SystemExit(0)])
def test_whoever_raises_lets_its_seat_down_and_the_world_goes_on(raised: BaseException) -> None:
    watch = Watch()
    assert ask(raised, watch).fault == "policy_raised"
    assert watch.asked[1:] == (NOBODY, NOBODY, 60.0)
