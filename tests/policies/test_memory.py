"""Freed memory is kept for what comes next."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

MEASURE = """
import resource, sys
import numpy as np
from nathlon.policies.qrsac.memory import keep_freed_memory

if sys.argv[1] == "keep":
    keep_freed_memory()
np.ones(2**24)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
np.ones(2**24)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="needs glibc")
def test_memory_that_was_freed_needs_no_new_pages() -> None:
    """128 MiB a second time: nothing is mapped anew, but for what the interpreter itself takes."""
    pages = {
        mode: int(subprocess.check_output([sys.executable, "-c", MEASURE, mode])) for mode in ("keep", "free")
    }
    assert pages["keep"] < 20
    # Fewer where the system hands out huge pages.
    assert pages["free"] > 50
