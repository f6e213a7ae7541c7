"""Threads that steal work: all of it is done, each thing once, whoever comes late."""

from __future__ import annotations

import gc
import threading
import time
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nathlon.sim.kernel import lean_kernel
from nathlon.sim.work_stealing import LINE, Tally, ThreadPool, finish, take


@lean_kernel
def mark(done: np.ndarray, by: np.ndarray, tally: Tally, thread: int) -> None:
    """Count how often each thing is taken, and by whom last."""
    while True:
        index = take(tally, thread, len(done))
        if index < 0:
            return
        done[index] += 1
        by[index] = thread
        finish(tally, thread)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 5), st.integers(0, 40), st.data())
def test_one_thread_does_what_others_leave_its_own_share_first(
    count: int, things: int, data: st.DataObject
) -> None:
    tally = np.zeros((2, count, LINE), np.int64)
    done, by = np.zeros(things, np.int64), np.full(things, -1)
    own = data.draw(st.integers(0, count - 1))
    order: list[int] = []
    while (index := take(tally, own, things)) >= 0:
        order.append(index)
    share = range(things * own // count, things * (own + 1) // count)
    assert order[: len(share)] == list(share)
    assert sorted(order) == list(range(things))
    mark(done, by, tally, own)
    assert not done.any()


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_each_thing_is_done_once_and_all_are_done_on_return(count: int) -> None:
    threads = ThreadPool(count)
    for things in (0, 1, 2, 50, 3_000) * 20:
        done, by = np.zeros(things, np.int64), np.zeros(things, np.int64)
        threads.run(partial(mark, done, by), things)
        np.testing.assert_array_equal(done, 1)


def test_the_caller_does_not_wait_for_a_thread_that_comes_late() -> None:
    threads, late = ThreadPool(2), threading.Event()
    done, by = np.zeros(50, np.int64), np.full(50, -1)

    def work(tally: Tally, thread: int) -> None:
        if thread == 1:
            assert late.wait(30.0)
        mark(done, by, tally, thread)

    threads.run(work, len(done))
    late.set()
    np.testing.assert_array_equal(done, 1)
    np.testing.assert_array_equal(by, 0)


def test_the_caller_waits_for_what_another_thread_has_begun() -> None:
    threads, begun = ThreadPool(2), threading.Event()
    done = np.zeros(2, np.int64)

    def work(tally: Tally, thread: int) -> None:
        if thread == 0:
            assert begun.wait(30.0)
        while (index := take(tally, thread, len(done))) >= 0:
            if thread == 1:
                begun.set()
                time.sleep(0.05)
            done[index] += 1
            finish(tally, thread)

    threads.run(work, len(done))
    np.testing.assert_array_equal(done, 1)


def test_an_error_reaches_the_caller_and_the_threads_go_on() -> None:
    threads = ThreadPool(3)

    def fail(tally: Tally, thread: int) -> None:
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        threads.run(fail, 5)
    done, by = np.zeros(50, np.int64), np.zeros(50, np.int64)
    threads.run(partial(mark, done, by), len(done))
    np.testing.assert_array_equal(done, 1)


def test_the_threads_end_with_their_owner() -> None:
    before = set(threading.enumerate())
    threads = ThreadPool(4)
    helpers = set(threading.enumerate()) - before
    assert len(helpers) == 3
    del threads
    gc.collect()
    for helper in helpers:
        helper.join(30.0)
        assert not helper.is_alive()
