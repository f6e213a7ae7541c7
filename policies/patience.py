"""What a process in which policies run is granted."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

ANSWER_S = 10.0
"""A policy that has not answered for so long has timed out: a hundred times what is between two ticks."""
FIRST_ANSWER_S = 120.0
"""Its first answer may take longer, and so may its loading: libraries start and compile."""
BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables of the environment that are 1 there."""
WORLD_OPENS_S = 100.0
"""A world in another interpreter has so long to begin, and for every reset: simulators load their assets."""
WORLD_ANSWER_S = 60.0
"""One that has not made a step for so long hangs."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Processes started meanwhile take the setting from their environment, before they load BLAS."""
    before = {name: os.environ.get(name) for name in BLAS_THREADS}
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
