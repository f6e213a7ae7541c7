"""Processes that share the work of one."""

from __future__ import annotations

import os
import subprocess
import sys
import time

PROGRAM = """
import os
from nathlon.policies.training.processes import start_processes
if __name__ == "__main__":
    with start_processes(1) as processes:
        print(processes.submit(os.getpid).result(), flush=True)
        input()
"""
PATIENCE_S = 30.0


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_they_end_with_the_one_that_is_killed() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        assert alive(child)
        parent.kill()
        end = time.monotonic() + PATIENCE_S
        while alive(child) and time.monotonic() < end:
            time.sleep(0.05)
    assert not alive(child)
