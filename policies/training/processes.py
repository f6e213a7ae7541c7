"""Processes that share the work of one on this machine."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import torch

from nathlon.policies.hosting.spawned import FreshProcesses, obey_parent, starting_processes


def start_processes(count: int | None = None) -> ProcessPoolExecutor:
    """Processes that begin afresh, work on one thread each, and end with this one however it ends.

    Args:
        count: how many; without it, one for each core.
    """
    # It starts Python's tracker of shared resources at once.
    with starting_processes():
        return ProcessPoolExecutor(count, FreshProcesses(), _begin)


def _begin() -> None:
    obey_parent()
    torch.set_num_threads(1)
