"""Readers of MCAP in other languages, Rust's and JavaScript's, find in a recording what was written."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from nathlon.arena.race_log import CAR_SAMPLE, RaceLog
from nathlon.arena.recording import write_recording
from tests.support.race_logs import oval_race

pytestmark = pytest.mark.takes_long

SOURCES = Path(__file__).parent.parent / "readers"
SCHEMAS = {
    "/race": "nathlon.Race",
    "/cars": "nathlon.CarStates",
    "/incidents": "nathlon.Incident",
    "/scene": "foxglove.SceneUpdate",
    "/transforms": "foxglove.FrameTransforms",
    "/log": "foxglove.Log",
}
CHUNK_CRC = 1 + 8 + 3 * 8
"""Bytes of a chunk before its checksum: opcode, length, times of its messages and its size."""
Reader = Callable[[Path], "subprocess.CompletedProcess[str]"]


def run(*command: str | Path, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    # Where there is no registry, one attempt tells.
    environment = {**os.environ, "CARGO_NET_RETRY": "0", "CARGO_HTTP_TIMEOUT": "20"}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=1800
    )


def built(language: str, folder: Path) -> list[str | Path]:
    """The command of a reader, built in a folder; the test is skipped where its packages cannot be had."""
    if language == "rust":
        tool, fetch = "cargo", ["cargo", "fetch"]
        build = ["cargo", "build", "--quiet", "--offline"]
        command: list[str | Path] = [folder / "target" / "debug" / "read-mcap"]
    else:
        tool, fetch = "npm", ["npm", "install", "--no-package-lock", "--no-audit", "--fetch-retries=0"]
        build = ["node", "--check", "read.mjs"]
        command = ["node", folder / "read.mjs"]
    if shutil.which(tool) is None:
        pytest.skip(f"needs {tool}: see your system's packages or the tool's own installer")
    shutil.copytree(SOURCES / language, folder, dirs_exist_ok=True)
    fetched = run(*fetch, folder=folder)
    if fetched.returncode != 0:
        pytest.skip(f"{tool} cannot fetch packages here: {fetched.stderr[-300:]}")
    done = run(*build, folder=folder)
    assert done.returncode == 0, done.stderr
    return command


@pytest.fixture(scope="module", params=["rust", "node"])
def reader(request: pytest.FixtureRequest) -> Reader:
    """Reads a file; what was built for it stays in pytest's cache, as it takes a minute."""
    cache: pytest.Cache = request.config.cache
    command = built(request.param, cache.mkdir(f"read_mcap_{request.param}"))
    return lambda path: run(*command, path)


@pytest.fixture(scope="module")
def log() -> RaceLog:
    return oval_race(cars=3, duration_s=20.0)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory, log: RaceLog) -> Path:
    path = tmp_path_factory.mktemp("recording") / "race.mcap"
    write_recording(path, log)
    return path


def test_they_find_all_messages_and_read_them_by_the_schemas_in_the_file(
    reader: Reader, recording: Path, log: RaceLog
) -> None:
    done = reader(recording)
    assert done.returncode == 0, done.stderr
    topics: dict[str, dict[str, Any]] = json.loads(done.stdout)
    assert {topic: found["schema"] for topic, found in topics.items()} == SCHEMAS
    for found in topics.values():
        assert (found["schema_encoding"], found["message_encoding"]) == ("protobuf", "protobuf")
    ticks, incidents = len(log.time_s), len(log.incidents)
    assert {topic: found["messages"] for topic, found in topics.items()} == {
        **{"/race": 1, "/scene": 1, "/cars": ticks, "/transforms": ticks},
        **{"/incidents": incidents, "/log": incidents},
    }
    last = topics["/cars"]["last"]
    assert last["time_s"] == log.time_s[-1]
    for car, state in enumerate(last["cars"]):
        for name in CAR_SAMPLE.names or ():
            assert state[name] == log.samples[name][-1, car].item(), name
    for car, frame in enumerate(topics["/transforms"]["last"]["transforms"]):
        sample = log.samples[-1, car]
        assert (frame["parent_frame_id"], frame["child_frame_id"]) == ("world", f"car_{car}")
        assert frame["translation"] == {axis: sample[f"{axis}_m"] for axis in "xyz"}
    assert topics["/incidents"]["last"]["text"] == topics["/log"]["last"]["message"] == log.incidents[-1].text
    assert topics["/race"]["last"]["names"] == list(log.names)
    entities = topics["/scene"]["last"]["entities"]
    assert [entity["frame_id"] for entity in entities] == ["world", "car_0", "car_1", "car_2"]


def test_they_check_the_checksum_of_a_chunk(reader: Reader, recording: Path, tmp_path: Path) -> None:
    with recording.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    content = bytearray(recording.read_bytes())
    content[summary.chunk_indexes[0].chunk_start_offset + CHUNK_CRC] ^= 1
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content)
    done = reader(path)
    assert done.returncode != 0
    assert "crc" in done.stderr.lower()
