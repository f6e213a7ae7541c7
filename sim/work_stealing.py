"""Work stealing: threads share work on many like things, and each takes the next until none is left.

To wake a thread takes tens of microseconds, and all that a world has to do takes some hundreds. So nobody is
waited for that wakes late, or shares a core with another program: the others take its share. What is taken
has to be independent of which thread takes it and when.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from queue import SimpleQueue
from threading import Thread
from typing import Any
from weakref import finalize

import numpy as np
from numba import int64
from numba.extending import intrinsic
from numpy.typing import NDArray

from nathlon.sim.kernel import lean_inlined, lean_kernel

LINE = 8
"""Numbers in a line of the cache: threads that write in the same one hinder each other."""
PATIENCE = 20_000
"""How often the caller's thread looks whether the others are done before it sleeps."""
NAP_S = 1e-5

Tally = NDArray[np.int64]
"""(2, threads, LINE): the first numbers of its lines are how many of each thread's share are taken, and how
many things each thread has done."""
Work = Callable[[Tally, int], None]
"""A thread's part of the work, given the tally and which thread it is: takes until nothing is left."""


def _first(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return context.make_array(signature.args[0])(context, builder, arguments[0]).data


def _increase(_context: Any, line: Any) -> Any:
    def build(context: Any, builder: Any, *call: Any) -> Any:
        one = context.get_constant(int64, 1)
        return builder.atomic_rmw("add", _first(context, builder, *call), one, "acq_rel")

    return int64(line), build


def _look(_context: Any, line: Any) -> Any:
    def build(context: Any, builder: Any, *call: Any) -> Any:
        return builder.load_atomic(_first(context, builder, *call), "acquire", 8)

    return int64(line), build


# A kernel leaves out the context, which types cannot tell.
increase: Any = intrinsic(_increase)
"""`increase(line)`: add one to the first of some int64 and tell what it was, as one step for all threads."""
look: Any = intrinsic(_look)
"""`look(line)`: the first of some int64, with all that was done before others increased it."""


@lean_inlined
def take(tally: Tally, thread: int, count: int) -> int:
    """Take the next of `count` things, of a thread's own share first, then of the others'.

    Returns:
        its index, or -1 if all are taken.
    """
    threads = tally.shape[1]
    for turn in range(threads):
        share = (thread + turn) % threads
        first, end = count * share // threads, count * (share + 1) // threads
        if look(tally[0, share]) < end - first:
            index = first + increase(tally[0, share])
            if index < end:
                return index
    return -1


@lean_inlined
def finish(tally: Tally, thread: int) -> None:
    """Note that what the thread took last is done."""
    increase(tally[1, thread])


@lean_kernel
def wait(tally: Tally, count: int) -> bool:
    """Look until `count` things are done, or for long enough; tells whether they are."""
    for _ in range(PATIENCE):
        done = 0
        for thread in range(tally.shape[1]):
            done += look(tally[1, thread])
        if done == count:
            return True
    return False


def _help(jobs: SimpleQueue[tuple[Work, Tally, int] | None]) -> None:
    while job := jobs.get():
        work, tally, thread = job
        with suppress(Exception):  # the caller's thread meets it too
            work(tally, thread)
        del job, work, tally


class ThreadPool:
    """The caller's thread and others that help it.

    Attributes:
        count: how many threads there are.
    """

    def __init__(self, count: int) -> None:
        """A number of threads, the caller's included."""
        self.count = count
        self._jobs: SimpleQueue[tuple[Work, Tally, int] | None] = SimpleQueue()
        for _ in range(count - 1):
            Thread(target=_help, args=(self._jobs,), daemon=True).start()
            finalize(self, self._jobs.put, None)

    def run(self, work: Work, count: int) -> None:
        """Have the threads work on `count` things; returns when all are done."""
        tally = np.zeros((2, self.count, LINE), np.int64)
        for thread in range(1, self.count):
            self._jobs.put((work, tally, thread))
        work(tally, 0)
        while not wait(tally, count):
            time.sleep(NAP_S)
