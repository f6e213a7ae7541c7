"""Who tells a night: one of the processes that share its store."""

from __future__ import annotations

import os
from functools import cache

from nathlon.arena.claimant import owner_name, release_the_dead
from nathlon.arena.store import Store

LEASE_S = 600.0
"""For which a night is one process's to tell: longer than all sinks together may take."""


def claim(store: Store, night: str | None) -> bool:
    """Whether this process is to tell a night, and no other for as long as it may take.

    A process that has ended on this machine gives way at once, one elsewhere when its lease ends.

    Args:
        store: which they share.
        night: its name; None for files that were set aside on none.
    """
    release_the_dead(store)
    return bool(store.claim([_key(night)], _owner(os.getpid()), LEASE_S))


def drop(store: Store, night: str | None) -> None:
    """Let others tell it."""
    store.drop([_key(night)], _owner(os.getpid()))


def _key(night: str | None) -> str:
    return f"telling {night or 'files set aside'}"


@cache
def _owner(process: int) -> str:
    return owner_name(process)
