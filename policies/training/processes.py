"""Processes that share the work of one on this machine."""

from __future__ import annotations

import os
import signal
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import parent_process
from threading import Thread

import torch

from nathlon.policies.child_processes import FreshProcesses, starting_processes


def start_processes(count: int | None = None) -> ProcessPoolExecutor:
    """Processes that begin afresh, work on one thread each, and end with this one however it ends.

    Args:
        count: how many; without it, one for each core.
    """
    # It starts Python's tracker of shared resources at once.
    with starting_processes():
        return ProcessPoolExecutor(count, FreshProcesses(), _begin)


def _begin() -> None:
    # Ctrl-C reaches the whole group; the process that started these decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    torch.set_num_threads(1)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    assert parent is not None, "it was started by one"
    parent.join()
    os._exit(1)
