"""Where matches run: processes on this machine, results whole and in order of completion."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import lru_cache
from multiprocessing import active_children, get_context

import polars as pl

from arena.match import Match
from arena.runner import run_match
from policies.load import load_policy
from policies.policy import Policy

BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@lru_cache(maxsize=256)
def _policy(source: str, circuit: str, car: str) -> Policy:
    return load_policy(source, circuit, car)


def match_policies(match: Match) -> list[Policy]:
    """The policies of a match, in the order of its entrants."""
    return [_policy(source, match.circuit, match.car) for source in match.sources]


def _run(match: Match) -> pl.DataFrame:
    return run_match(match, match_policies(match))


def run_matches(matches: Sequence[Match], workers: int) -> Iterator[tuple[Match, pl.DataFrame]]:
    """Run matches side by side and yield each with its results as it ends.

    Results do not depend on the number of workers: a match is always one batch in one process.
    """
    if not matches:
        return
    # Workers take the setting from their environment, before they load BLAS.
    before = {name: os.environ.get(name) for name in BLAS_THREADS}
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))
    try:
        # Ctrl-C is for this process to handle; it then ends its workers at once, for a match that is
        # not finished is not stored.
        with ProcessPoolExecutor(
            min(workers, len(matches)),
            mp_context=get_context("spawn"),
            initializer=signal.signal,
            initargs=(signal.SIGINT, signal.SIG_IGN),
        ) as pool:
            try:
                running = {pool.submit(_run, match): match for match in matches}
                for done in as_completed(running):
                    yield running[done], done.result()
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                for worker in active_children():
                    worker.terminate()
                raise
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
