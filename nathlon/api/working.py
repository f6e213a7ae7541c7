"""`nathlon.work`: take part in the selections of a store."""

from __future__ import annotations

from collections.abc import Collection

from nathlon.arena.pool import Pool
from nathlon.arena.queue_worker import WAIT_S, Shift
from nathlon.arena.queue_worker import work as work_for
from nathlon.arena.store import Store
from nathlon.progress import stage_progress, worker_count


def work(
    store: str,
    *,
    workers: int | None = None,
    worlds: Collection[str] = (),
    wait_s: float = WAIT_S,
    progress: bool = True,
) -> Shift:
    """Race the matches that wait in a store, until none has waited for a while.

    Args:
        store: path of its file, or URL of a database, which may still be empty.
        workers: processes; one for each core by default.
        worlds: names of simulators that may be loaded, beside nathlon's own: they are code.
        wait_s: how long to wait for matches, s.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if the store cannot be used, or this machine can run nothing of what waits there.
    """
    with (
        Store(store, must_exist="://" not in store) as opened,
        Pool(worker_count(workers)) as pool,
        stage_progress(progress, ("worker",)) as on_match,
    ):
        # How many there will be nobody knows.
        return work_for(opened, pool, worlds, wait_s, on_match=lambda count: on_match("worker", count, count))
