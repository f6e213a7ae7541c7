"""Files of policies with one thing changed where it matters: a policy or a sentence, and little memory.

Files that were spoilt without a plan are in `test_mutations`. Here the changed part is packed again so that
sums and lengths are right, and what it says is believed by whoever does not look.
"""

from __future__ import annotations

import io
import json
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from stable_baselines3 import SAC

from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.load import load_file
from nathlon.policies.sources.onnx import export_onnx
from nathlon.sim.errors import InputError
from tests.policies.test_sb3 import save, zipped
from tests.policies.test_state_dict import weights_of, with_weights
from tests.support.checkpoints import BUNDLED

ATTACKS = 150
MOST_GROWTH = 256 << 20
"""Bytes of memory that opening small files may take beyond what the programs held before."""

Change = Callable[[bytes, np.random.Generator], bytes]
VALUES: list[Any] = [
    *(None, True, -1, 0, 1, 2, 7, 2**31, 2**62, 2**63, 10**30, 0.5, 1e308, float("nan")),
    *("", "F32", "F64", "\x1b[2J", "\ud800", "a" * 100_000, [], {}, [[]], [2**40, 2**40], [-1, 2], {"": {}}),
]


def pick(rng: np.random.Generator, among: Any) -> Any:
    return among[int(rng.integers(len(among)))]


def flip(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        changed[int(rng.integers(len(changed)))] = int(rng.integers(256))
    return bytes(changed)


def cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: int(rng.integers(len(content)))]


def change_json(text: str, rng: np.random.Generator) -> str:
    """The text with one value replaced, left out or repeated, at any depth, JSON in strings included."""
    root = {"": json.loads(text)}
    place: Any = root
    while True:
        key = pick(rng, list(place.keys() if isinstance(place, dict) else range(len(place))))
        inner = place[key]
        if isinstance(inner, str) and inner.startswith("{") and rng.random() < 0.8:
            place[key] = change_json(inner, rng)
        elif isinstance(inner, dict | list) and inner and (place is root or rng.random() < 0.8):
            place = inner
            continue
        elif isinstance(place, dict) and place is not root and rng.random() < 0.2:
            del place[key]
        else:
            place[key] = pick(rng, VALUES)
        return json.dumps(root[""])


def change_header(content: bytes, rng: np.random.Generator) -> bytes:
    end = 8 + int.from_bytes(content[:8], "little")
    header = change_json(content[8:end].decode(), rng).encode()
    return len(header).to_bytes(8, "little") + header + content[end:]


def change_length(content: bytes, rng: np.random.Generator) -> bytes:
    return struct.pack("<Q", pick(rng, [0, 1, 100, len(content), 2**31, 2**63, 2**64 - 1])) + content[8:]


def change_settings(content: bytes, rng: np.random.Generator) -> bytes:
    members = unzipped(content)
    return zipped(members | {"data": change_json(members["data"].decode(), rng).encode()})


def change_weights(content: bytes, rng: np.random.Generator) -> bytes:
    """One member of the weights changed, or a number in their pickle, in archives that are whole."""
    members = unzipped(content)
    inner = unzipped(members["policy.pth"])
    name = pick(rng, [pick(rng, list(inner)), *(each for each in inner if each.endswith("data.pkl"))])
    inner[name] = pick(rng, [flip, flip, cut])(inner[name] or b"\0", rng)
    return zipped(members | {"policy.pth": zipped(inner, zipfile.ZIP_STORED)})


def change_entry(content: bytes, rng: np.random.Generator) -> bytes:
    """A field of an entry in the table of contents."""
    start = content.rindex(b"PK\x05\x06")
    changed = bytearray(content)
    (first,) = struct.unpack_from("<I", content, start + 16)
    place = pick(rng, [content.index(b"PK\x01\x02", first), start]) + 4 + 2 * int(rng.integers(0, 20))
    struct.pack_into("<H", changed, min(place, len(changed) - 2), pick(rng, [0, 1, 8, 12, 14, 0xFFFF]))
    return bytes(changed)


def unzipped(content: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def change_field(content: bytes, rng: np.random.Generator) -> bytes:
    """A field of any message of a graph."""
    message: Any = onnx.load_model_from_string(content)
    model = message
    while True:
        field, value = pick(rng, message.ListFields())
        if field.message_type is None:
            break
        message = pick(rng, value) if field.is_repeated else value
        if not message.ListFields():
            return content
    chosen: Any = {
        field.CPPTYPE_STRING: ["", "x", "observation", "Loop", "Constant", "ConstantOfShape", "a" * 10_000],
        field.CPPTYPE_FLOAT: [0.0, float("nan"), 1e38],
        field.CPPTYPE_DOUBLE: [0.0, float("nan"), 1e308],
    }.get(field.cpp_type, [-(2**31), -1, 0, 1, 2, 7, 16, 2**31 - 1])
    chosen = pick(rng, chosen)
    if field.type == field.TYPE_BYTES:
        chosen = chosen.encode()
    if field.cpp_type == field.CPPTYPE_INT64 and rng.random() < 0.5:
        chosen = int(pick(rng, [2**40, -(2**63), 2**63 - 1]))
    try:
        if field.is_repeated:
            value[int(rng.integers(len(value)))] = chosen
        else:
            setattr(message, field.name, chosen)
    except ValueError:  # no member of an enumeration
        message.ClearField(field.name)
    return model.SerializeToString()


def peak() -> int:
    """Bytes of the most memory that this process has held since `forget_peak`."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) << 10


def forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A small policy in every kind of file."""
    folder = tmp_path_factory.mktemp("whole")
    small, graph, stored = (folder / name for name in ("bundled.safetensors", "bundled.onnx", "saved.zip"))
    small.write_bytes(BUNDLED[0].read_bytes())
    export_onnx(load_checkpoint(small), graph)
    save(SAC, stored)
    slim = with_weights(stored, folder / "slim.zip", zipped(weights_of(stored), zipfile.ZIP_STORED))
    return {path.suffix: path for path in (small, slim, graph)}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("suffix", "changes"),
    [
        (".safetensors", (flip, cut, change_length, change_header, change_header, change_header)),
        (".zip", (flip, cut, change_entry, change_settings, change_weights, change_weights)),
        (".onnx", (flip, cut, change_field, change_field, change_field)),
    ],
)
def test_attacks(tmp_path: Path, files: dict[str, Path], suffix: str, changes: tuple[Change, ...]) -> None:
    whole = files[suffix].read_bytes()
    load_file(files[suffix])
    rng = np.random.default_rng(1)
    path = tmp_path / f"policy{suffix}"
    forget_peak()
    before = peak()
    said: list[str] = []
    for index in range(ATTACKS):
        path.write_bytes(changes[index % len(changes)](whole, rng))
        try:
            policy = load_file(path)
        except InputError as error:
            said.append(str(error))
        else:
            actions, _ = policy.act(
                np.zeros((2, policy.observation_spec.size), np.float32), policy.initial_memory(2)
            )
            assert actions.shape == (2, 2)
    assert len(said) > ATTACKS // 4, "the changes do matter"
    assert all(sentence.startswith(f"{path}: ") for sentence in said)
    assert all(sentence.removeprefix(f"{path}: ").isprintable() for sentence in said)
    assert peak() - before < MOST_GROWTH
