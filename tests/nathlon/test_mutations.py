"""Files that were spoilt on their way: refused with a sentence or read, but never a traceback, never code."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from stable_baselines3 import SAC

from nathlon import sim
from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.load import load_file
from nathlon.policies.sources.onnx import export_onnx
from nathlon.policies.training.config import CONFIGS, read_config
from nathlon.sim.car import read_car
from nathlon.sim.errors import InputError
from nathlon.sim.track import read_track
from nathlon.sim.track.formats.reading import read_outline
from nathlon.sim.track.lap_line import lap_line
from tests.policies.test_sb3 import save
from tests.support.checkpoints import BUNDLED
from tests.support.circuit_dialects import DIALECTS

DATA = Path(str(sim.__file__)).parent / "data"
RUNS_CODE = {
    "pickle.find_class",
    "subprocess.Popen",
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "os.fork",
    "socket.connect",
    "ctypes.dlopen",
}
TOKENS = [
    b"nan",
    b"-1",
    b"0",
    b"1e308",
    b"-inf",
    b'""',
    b"[]",
    b"{}",
    b"true",
    b"\xff",
    b"'",
    b"\n\n",
    b"= =",
]
READERS = (
    *("database", "semicolons", "gpx", "kml", "geojson", "osm", "commonroad"),
    *("torcs", "arcs", "fastest-lap", "fast_lane.ai"),
)
"""A dialect for each reader of circuits."""

watching = False
caught: list[str] = []


def _watch(event: str, _: tuple[Any, ...]) -> None:
    if watching and event in RUNS_CODE:
        caught.append(event)


sys.addaudithook(_watch)


@contextmanager
def nothing_runs() -> Iterator[None]:
    """Fail where anything is unpickled, started, loaded as a library or connected to."""
    global watching
    caught.clear()
    watching = True
    try:
        yield
    finally:
        watching = False
    assert not caught


@st.composite
def spoilt(draw: st.DrawFn, whole: bytes, tokens: bool) -> bytes:
    """The bytes of a file after one to four accidents."""
    data = bytearray(whole)
    # What says how to read the rest stands at either end of binary files.
    ends = min(len(data), 600)
    for _ in range(draw(st.integers(1, 4))):
        place = draw(
            st.integers(0, max(len(data) - 1, 0))
            | st.integers(0, min(ends, max(len(data) - 1, 0)))
            | st.integers(max(len(data) - ends, 0), max(len(data) - 1, 0))
        )
        length = draw(st.integers(1, 40))
        accidents = ["flip", "cut", "drop", "repeat", "swap"] + ["token"] * (3 if tokens else 0)
        match draw(st.sampled_from(accidents)):
            case "flip" if data:
                data[place] ^= 1 << draw(st.integers(0, 7))
            case "cut":
                del data[place:]
            case "drop":
                del data[place : place + length]
            case "repeat":
                data[place:place] = data[place : place + length]
            case "swap":
                data[place : place + length] = draw(st.binary(max_size=length))
            case "token":
                data[place : place + draw(st.integers(0, 6))] = draw(st.sampled_from(TOKENS))
    return bytes(data)


def survives(read: Callable[[Path], object], name: str, data: bytes) -> None:
    """Read a spoilt file: one sentence or none, and nothing of it runs."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(data)
        with nothing_runs():
            said = ["read"]
            try:
                read(path)
            except InputError as error:
                said = str(error).strip().splitlines()
            assert len(said) == 1


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """A small policy in every kind of file that may race."""
    folder = tmp_path_factory.mktemp("models")
    save(SAC, folder / "sac.zip")
    export_onnx(load_checkpoint(BUNDLED[0]), folder / "bundled.onnx")
    files = {".safetensors": BUNDLED[0], ".zip": folder / "sac.zip", ".onnx": folder / "bundled.onnx"}
    for path in files.values():
        load_file(path)
    return {suffix: path.read_bytes() for suffix, path in files.items()}


SETTINGS = settings(
    max_examples=150,
    deadline=None,
    derandomize=True,
    suppress_health_check=[
        HealthCheck.function_scoped_fixture,
        HealthCheck.too_slow,
        HealthCheck.data_too_large,
    ],
)


@pytest.mark.parametrize("suffix", [".safetensors", ".zip", ".onnx"])
@SETTINGS
@given(data=st.data())
def test_spoilt_checkpoints(models: dict[str, bytes], suffix: str, data: st.DataObject) -> None:
    survives(load_file, f"policy{suffix}", data.draw(spoilt(models[suffix], tokens=False)))


@SETTINGS
@given(data=st.data())
def test_spoilt_training_configurations(data: st.DataObject) -> None:
    whole = (CONFIGS / "racing.toml").read_bytes()
    survives(read_config, "racing.toml", data.draw(spoilt(whole, tokens=True)))


@SETTINGS
@given(data=st.data())
def test_spoilt_cars(data: st.DataObject) -> None:
    survives(read_car, "car.toml", data.draw(spoilt((DATA / "cars" / "gt3.toml").read_bytes(), tokens=True)))


@SETTINGS
@given(data=st.data())
def test_spoilt_circuits(data: st.DataObject) -> None:
    folder = DATA / "circuits" / "lindenring"

    def read(path: Path) -> None:
        (path.parent / "centre_line.csv").write_bytes((folder / "centre_line.csv").read_bytes())
        read_track(path)

    survives(read, "circuit.toml", data.draw(spoilt((folder / "circuit.toml").read_bytes(), tokens=True)))


@cache
def described(dialect: str) -> bytes:
    """A circuit as a file of a dialect."""
    return DIALECTS[dialect][0]()


@pytest.mark.parametrize("dialect", READERS)
@SETTINGS
@given(data=st.data())
def test_spoilt_files_that_describe_circuits(dialect: str, data: st.DataObject) -> None:
    survives(
        lambda path: lap_line(read_outline(path)),
        "circuit.dat",
        data.draw(spoilt(described(dialect), tokens=dialect != "fast_lane.ai")),
    )
