"""The searched lap: it gets farther than the policy it starts from, by driving alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.lap_search import TAKEN, Search
from benchmarks.time_trial import SEED
from nathlon.policies.bundled import BUNDLED
from nathlon.policies.checkpoint import NetworkPolicy, load_checkpoint

CHECKPOINT = BUNDLED / "lindenring" / "lindenring-s1-020k.safetensors"
TO_THE_FIRST_BEND = 80
SEARCHES = 20


@pytest.fixture(scope="module")
def policy() -> NetworkPolicy:
    return load_checkpoint(CHECKPOINT)


def before_the_first_bend(policy: NetworkPolicy) -> Search:
    search = Search(policy, np.random.default_rng(SEED))
    for _ in range(TO_THE_FIRST_BEND):
        search.drive()
    return search


def test_a_search_gets_farther_than_its_policy(policy: NetworkPolicy) -> None:
    search, alone = before_the_first_bend(policy), before_the_first_bend(policy)
    for _ in range(SEARCHES):
        search.search()
    for _ in range(SEARCHES * TAKEN):
        alone.drive()
    assert search.world.time == alone.world.time
    assert search.car["progress"] > alone.car["progress"] + 2.0
    assert search.car["off_course_s"] == search.car["wall_s"] == 0.0


def test_what_is_no_checkpoint_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    path.write_bytes(b"none")
    run = subprocess.run(
        [sys.executable, "-m", "benchmarks.lap_search", str(path)], capture_output=True, text=True
    )
    assert run.returncode == 2
    assert str(path) in run.stderr
    assert "Traceback" not in run.stderr
