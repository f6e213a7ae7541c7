"""Readers of MCAP in other languages, Rust's and JavaScript's, find in a recording what was written."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from rerun.chunk import McapReader

from nathlon.arena.race_log import CAR_SAMPLE, RaceLog
from nathlon.arena.recording import write_recording
from tests.support.race_logs import oval_race

JAVASCRIPT = Path(__file__).parent.parent / "readers" / "node"
RERUN = Path(sys.executable).with_name("rerun")
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
Topics = dict[str, dict[str, Any]]
"""By topic its schema and encodings, how many messages there are, and the last one."""
Reader = Callable[[Path], Topics]


class FaultyError(Exception):
    """A reader complains of a file."""


def run(*command: str | Path) -> str:
    """What a command prints."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    if done.returncode != 0:
        raise FaultyError(done.stderr)
    return done.stdout


def by_rust(path: Path) -> Topics:
    """As Rerun reads it, which is made of the crates `mcap` and `prost-reflect`."""
    run(RERUN, "mcap", "check", path)  # the stream leaves out what is faulty
    reader = McapReader(path, decoders=["protobuf"])
    topics: Topics = {
        channel.topic: {
            "schema": channel.schema.name,
            "schema_encoding": channel.schema.encoding,
            "message_encoding": channel.message_encoding,
            "messages": 0,
        }
        for channel in reader.info().channels
        if channel.schema
    }
    for chunk in reader.stream():
        rows, topic = chunk.to_record_batch().to_pylist(), topics[chunk.entity_path]
        newest = max(rows, key=lambda row: row["message_log_time"])
        topic["messages"] += len(rows)
        if "last" not in topic or topic["at"] <= newest["message_log_time"]:
            topic["at"] = newest["message_log_time"]
            [topic["last"]] = newest[f"{topic['schema']}:message"]
    return topics


def by_javascript(folder: Path) -> Reader:
    """Node's reader, installed in a folder; the test is skipped where its packages cannot be had."""
    if shutil.which("npm") is None:
        pytest.skip("needs npm: see your system's packages or the tool's own installer")
    shutil.copytree(JAVASCRIPT, folder, dirs_exist_ok=True)
    # Where there is no registry, one attempt tells.
    options = ("--no-package-lock", "--no-audit", "--fetch-retries=0")
    try:
        run("npm", "install", *options, "--prefix", folder)
    except FaultyError as error:
        pytest.skip(f"npm cannot fetch packages here: {str(error)[-300:]}")
    return lambda path: json.loads(run("node", folder / "read.mjs", path))


@pytest.fixture(scope="module", params=["rust", "javascript"])
def reader(request: pytest.FixtureRequest) -> Reader:
    """Reads a file; what was fetched for it stays in pytest's cache."""
    if request.param == "rust":
        return by_rust
    cache: pytest.Cache = request.config.cache
    return by_javascript(cache.mkdir("read_mcap_node"))


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
    topics = reader(recording)
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
    with pytest.raises(FaultyError, match=r"(?i)crc"):
        reader(path)
