"""Temporary folders: none is left of a process that was killed."""

from __future__ import annotations

import os
import socket
import tempfile
import zlib
from pathlib import Path

import pytest

from nathlon.sim import scratch
from nathlon.sim.process import owner
from nathlon.sim.scratch import scratch_folder


@pytest.mark.skipif(not os.path.exists("/proc/self/ns/pid"), reason="needs Linux")
def test_containers_with_one_name_are_machines_of_their_own() -> None:
    """A process of one is not among those of the other, which would take it for one that has ended."""
    place = socket.gethostname() + os.readlink("/proc/self/ns/pid")
    assert owner().partition(".")[0] == f"{zlib.crc32(place.encode()):08x}"


def test_what_killed_processes_left_goes_when_the_next_one_makes_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    machine, start, process = owner().split(".")
    for earlier in (f"{machine}.{int(start) - 1}.{process}", f"{machine}.0.4194305"):
        (tmp_path / f"nathlon-{earlier}-abc" / "a.onnx").mkdir(parents=True)
    others = {
        f"nathlon-{(int(machine, 16) + 1) % 2**32:08x}.{start}.4194305-abc",
        f"nathlon-{os.getuid()}",
        "nathlon-runs",
    }
    for name in others:
        (tmp_path / name).mkdir()
    with scratch_folder() as first, scratch_folder() as second:
        assert set(os.listdir(tmp_path)) == {os.path.basename(first), os.path.basename(second), *others}
    assert set(os.listdir(tmp_path)) == others
    scratch._sweep.cache_clear()
