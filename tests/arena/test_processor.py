"""The kind of processor: the same in every process of a machine, another one where numpy's code is."""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys

import pytest

from nathlon.arena.processor import processor


def elsewhere(**settings: str) -> str:
    """What another process says, with these environment variables."""
    told = subprocess.run(
        [sys.executable, "-c", "from nathlon.arena.processor import processor; print(processor())"],
        env=os.environ | settings,
        capture_output=True,
        text=True,
        check=True,
    )
    return told.stdout.strip()


@pytest.mark.parametrize("threads", ["1", "2"])
def test_it_does_not_depend_on_the_process(threads: str) -> None:
    assert elsewhere(OPENBLAS_NUM_THREADS=threads, OMP_NUM_THREADS=threads) == processor()
    assert re.fullmatch(r"[\w.-]+-[0-9a-f]{4}", processor())


@pytest.mark.skipif(platform.machine() != "x86_64", reason="names of x86-64's processors")
def test_products_of_another_processor_s_code_are_another_kind() -> None:
    old, new = (elsewhere(OPENBLAS_CORETYPE=name) for name in ("Prescott", "Haswell"))
    assert old != new


def test_what_is_pinned_is_named() -> None:
    assert elsewhere(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="+sse2").startswith("generic-")
