"""Files of policies: read once and whole, or refused unread in one sentence."""

from __future__ import annotations

import hashlib
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from nathlon.policies.checkpoint import load_checkpoint, read_card, save_checkpoint
from nathlon.policies.load import load_file
from nathlon.policies.policy_file import MOST_BYTES, content_id, read_policy_file
from nathlon.policies.sources.onnx import export_onnx
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED
from tests.support.refusals import refusal

READERS: list[tuple[Callable[[Path], object], str]] = [
    (read_policy_file, ".safetensors"),
    (read_card, ".safetensors"),
    (load_file, ".safetensors"),
    (load_file, ".zip"),
    (load_file, ".onnx"),
]


@pytest.mark.parametrize(("read", "suffix"), READERS)
def test_what_is_no_file_is_refused_unread(
    tmp_path: Path, read: Callable[[Path], object], suffix: str
) -> None:
    pipe, folder, zeros, plug, astray, loop = (tmp_path / f"{name}{suffix}" for name in "abcdef")
    os.mkfifo(pipe)
    folder.mkdir()
    zeros.symlink_to("/dev/zero")
    astray.symlink_to(tmp_path / "nowhere")
    loop.symlink_to(loop)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(plug))
        for path, said in [
            (pipe, "a pipe or a device"),
            (folder, "Is a directory"),
            (zeros, "a pipe or a device"),
            (plug, "No such device"),
            (astray, "No such file"),
            (loop, "Too many levels"),
            (tmp_path / ("g" * 300 + suffix), "File name too long"),
        ]:
            with refusal(path, f"cannot read the policy: {said}"):
                read(path)
    with pytest.raises(InputError, match=r"cannot read the policy: a name has no zero byte"):
        read(tmp_path / f"a\0b{suffix}")


@pytest.mark.parametrize(("read", "suffix"), READERS)
def test_files_have_a_size(tmp_path: Path, read: Callable[[Path], object], suffix: str) -> None:
    path = tmp_path / f"policy{suffix}"
    path.touch()
    with refusal(path, "is empty"):
        read(path)
    os.truncate(path, MOST_BYTES + 1)
    with refusal(path, f"has {MOST_BYTES + 1} bytes, expected at most {MOST_BYTES}"):
        read(path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read all files")
def test_a_file_of_others_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    path.touch(0o000)
    with refusal(path, "cannot be read \\(Permission denied\\)"):
        read_policy_file(path)


def test_the_id_is_that_of_the_bytes(tmp_path: Path) -> None:
    path = tmp_path / "policy.onnx"
    path.write_bytes(b"some bytes")
    assert read_policy_file(path) == b"some bytes"
    assert content_id(b"some bytes") == hashlib.sha256(b"some bytes").hexdigest()


@pytest.mark.parametrize("suffix", [".safetensors", ".onnx"])
def test_a_file_that_changes_meanwhile_keeps_its_own_name(tmp_path: Path, suffix: str) -> None:
    files = {}
    for index in (0, -1):
        path = tmp_path / f"{index}{suffix}"
        if suffix == ".onnx":
            export_onnx(load_checkpoint(BUNDLED[index]), path)
        else:
            path.write_bytes(BUNDLED[index].read_bytes())
        policy = load_file(path)
        files[policy.id] = (path, policy.card)
    watched, spare, stop = tmp_path / f"watched{suffix}", tmp_path / "spare", threading.Event()
    paths = [path for path, _ in files.values()]
    watched.symlink_to(paths[0])

    def flip() -> None:
        while not stop.is_set():
            for path in paths:
                spare.symlink_to(path)
                os.replace(spare, watched)

    flipping = threading.Thread(target=flip)
    flipping.start()
    try:
        for _ in range(100):
            policy = load_file(watched)
            assert policy.card == files[policy.id][1]
    finally:
        stop.set()
        flipping.join()


HUNGRY = """
import resource, sys
from pathlib import Path
import onnxruntime, torch
import nathlon.policies.sb3_racer
from nathlon.policies.load import load_file
from nathlon.sim.errors import InputError
(held,) = (int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmData"))
resource.setrlimit(resource.RLIMIT_DATA, ((held << 10) + (200 << 20),) * 2)
for path in sys.argv[1:]:
    try:
        load_file(Path(path))
    except InputError as error:
        print(error)
"""


def test_too_little_memory_is_told(tmp_path: Path) -> None:
    from tests.policies.test_archive import pack
    from tests.policies.test_onnx import memory_eater

    wide, packed, eater = (tmp_path / name for name in ("wide.safetensors", "packed.zip", "eater.onnx"))
    card = load_checkpoint(BUNDLED[0]).card.model_copy(update={"hidden": (8192, 8192)})
    save_checkpoint(wide, {name: np.zeros(shape, np.float32) for name, shape in card.shapes.items()}, card)
    pack(packed, {"data": b"{}", "policy.pth": bytes(300 << 20)})
    eater.write_bytes(memory_eater().SerializeToString())
    done = subprocess.run(
        [sys.executable, "-c", HUNGRY, wide, packed, eater], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    said = done.stdout.splitlines()
    assert said == [
        f"{path}: needs more memory than opening a policy may take" for path in (wide, packed, eater)
    ]
