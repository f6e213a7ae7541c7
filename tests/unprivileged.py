"""Programs run as an ordinary user would run them: to root, permissions of files mean nothing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

BOUND = ("setpriv", "--bounding-set=-dac_override,-dac_read_search")


def ordinary(*command: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command without root's right to pass over permissions; skips the test where that cannot be."""
    bound: tuple[str, ...] = ()
    if os.geteuid() == 0:
        able = shutil.which(BOUND[0]) and subprocess.run([*BOUND, "true"], capture_output=True)
        if not able or able.returncode:
            pytest.skip("root cannot give up its rights here: setpriv is missing or not permitted")
        bound = BOUND
    return subprocess.run([*bound, *map(str, command)], cwd=cwd, capture_output=True, text=True)


def ordinary_nathlon(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    return ordinary(sys.executable, "-m", "nathlon.cli", *arguments, cwd=cwd)
