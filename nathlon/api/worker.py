"""`nathlon.work`: take part in the selections of a store."""

from __future__ import annotations

from collections.abc import Collection
from time import monotonic, sleep

from nathlon.arena.engine import POLL_S
from nathlon.arena.pool import Pool
from nathlon.arena.queue_worker import WAIT_S, Shift
from nathlon.arena.queue_worker import work as work_for
from nathlon.arena.store import Store
from nathlon.arena.store.opening import NoStoreError
from nathlon.terminal import warn
from nathlon.terminal.progress import stage_progress, worker_count


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
        store: path of its file, which need not be there yet, or URL of a database, which may still be empty.
        workers: processes; one for each core by default.
        worlds: names of simulators that may be loaded, beside nathlon's own: they are code.
        wait_s: how long to wait for matches, s.
        progress: whether to show it, on standard error.

    Raises:
        InputError: if the store cannot be used or does not come, or this machine can run nothing of what
            waits there.
    """
    processes = worker_count(workers)
    with _awaited(store, wait_s, progress) as opened, Pool(processes) as pool:
        if progress:
            warn(f"{opened.name}: at work with {processes} process{'es' * (processes > 1)}")
        with stage_progress(progress, ("worker",)) as on_match:
            # How many there will be nobody knows.
            return work_for(
                opened, pool, worlds, wait_s, on_match=lambda count: on_match("worker", count, count)
            )


def _awaited(store: str, wait_s: float, progress: bool) -> Store:
    """A store, as soon as whoever wants matches has made it."""
    until, waited = monotonic() + wait_s, False
    while True:
        try:
            return Store(store, must_exist="://" not in store)
        except NoStoreError:
            if monotonic() > until:
                raise
        if progress and not waited:
            warn(f"{store}: no such store yet; waiting for it for {wait_s:g} s")
        waited = True
        sleep(POLL_S)
