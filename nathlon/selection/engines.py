"""Which engine a selection uses, by its configuration."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from nathlon.arena.engine import MatchEngine
from nathlon.arena.pool import Pool
from nathlon.arena.queue_engine import QueueEngine
from nathlon.arena.store import Store
from nathlon.selection.config import Config


@contextmanager
def engine_of(config: Config, store: Store, pool: Pool) -> Iterator[MatchEngine]:
    """The engine that a configuration asks for.

    Raises:
        InputError: if its address leads nowhere, or what it needs is not installed.
    """
    if config.engine == "local":
        yield QueueEngine(store, pool)
        return
    from nathlon.arena.on_ray.cluster import joined

    with joined(config.engine_address):
        from nathlon.arena.on_ray.engine import RayEngine
        from nathlon.arena.on_ray.nodes import Nodes

        with Nodes(pool.log) as nodes:
            yield RayEngine(store, pool, nodes)
