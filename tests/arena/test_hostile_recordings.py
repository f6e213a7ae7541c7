"""Recordings that were spoilt, or made to do harm: one sentence, or a race that can be shown."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import register_schema

from nathlon.arena import _car_state_pb2 as pb
from nathlon.arena import recording as recording_module
from nathlon.arena.race_log import CAR_SAMPLE, Incident, NamedStretch, RaceLog
from nathlon.arena.recording import read_recording, recover_recording, write_recording
from nathlon.reports.player import render_player
from nathlon.sim.errors import InputError
from tests.support.command_line import nathlon, refused
from tests.support.race_logs import oval_race
from tests.support.spoiling import spoilt_bytes

MUTATIONS = 150
LOG = oval_race(cars=3, duration_s=5.0)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("whole") / "race.mcap"
    write_recording(path, LOG)
    return path.read_bytes()


def sealed(content: bytes) -> bytes:
    """The bytes of a recording with checksums that hold for what they are now."""
    if len(content) < 40:
        return content
    data = bytearray(content)
    (start,) = struct.unpack_from("<Q", data, len(data) - 28)
    if 13 <= start < len(data) - 12:
        struct.pack_into("<I", data, start - 4, zlib.crc32(data[: start - 13]))
        struct.pack_into("<I", data, len(data) - 12, zlib.crc32(data[start:-12]))
    return bytes(data)


@pytest.mark.parametrize("seal", [bytes, sealed])
def test_spoilt_recordings_are_one_sentence_or_a_race(
    tmp_path: Path, whole: bytes, seal: Callable[[bytes], bytes]
) -> None:
    rng, read = np.random.default_rng(1), 0
    said: list[tuple[Path, str]] = []
    for number in range(MUTATIONS):
        path = tmp_path / f"race-{number}.mcap"
        path.write_bytes(seal(spoilt_bytes(whole, rng)))
        for reader in (read_recording, lambda path: recover_recording(path).log):
            try:
                log = reader(path)
            except InputError as error:
                said.append((path, str(error)))
                continue
            render_player(log)
            read += 1
    assert all(sentence.startswith(str(path)) and sentence.isprintable() for path, sentence in said)
    assert 0 < read < 2 * MUTATIONS


def test_commands_leave_nothing_of_spoilt_recordings(tmp_path: Path, whole: bytes) -> None:
    path = tmp_path / "race.mcap"
    path.write_bytes(whole[:3000])
    refused(nathlon("replay", "race.mcap", "--html", "page.html", cwd=tmp_path), "race.mcap", "damaged")
    refused(
        nathlon("replay", "race.mcap", "--recover", cwd=tmp_path), "race.mcap", "nothing can be recovered"
    )
    assert [entry.name for entry in tmp_path.iterdir()] == ["race.mcap"]


def changed(**samples: object) -> RaceLog:
    """The race with other values in the fifth sample."""
    log = replace(LOG, samples=LOG.samples.copy())
    for name, value in samples.items():
        log.samples[name][5] = value
    return log


NUMBERS = [name for name in CAR_SAMPLE.names or () if CAR_SAMPLE[name].kind == "f"]
INCIDENT = Incident(1.0, "contact", (0, 1), "Car 0 runs into car 1.", fault=0)


@pytest.mark.parametrize(
    ("log", "said"),
    [
        *((changed(**{name: np.nan}), name) for name in NUMBERS),
        (changed(x_m=1e300), "x_m"),
        (changed(place=4), "place"),
        (changed(place=0), "place"),
        (changed(lap=-(2**31)), "lap"),
        (replace(LOG, time_s=LOG.time_s[::-1].copy()), "time_s"),
        (replace(LOG, time_s=LOG.time_s + 1e6), "time_s"),
        (replace(LOG, car_length_m=np.inf), "car_length_m"),
        (replace(LOG, car_width_m=0.0), "car_width_m"),
        (replace(LOG, sections=(NamedStretch("bend", "corner", 0.0, np.inf),)), "sections"),
        (replace(LOG, outline=replace(LOG.outline, left=LOG.outline.left * np.nan)), "left"),
        (replace(LOG, outline=replace(LOG.outline, centre=LOG.outline.centre * 0.0)), "centre"),
        (replace(LOG, incidents=(replace(INCIDENT, kind="murder"),)), "kind is 'murder'"),
        (replace(LOG, incidents=(replace(INCIDENT, cars=()),)), "names no car"),
        (replace(LOG, incidents=(replace(INCIDENT, fault=3),)), "names no car"),
        (replace(LOG, incidents=(replace(INCIDENT, penalty_s=np.nan),)), "/incidents"),
    ],
)
def test_what_no_race_has_is_refused_by_its_field(tmp_path: Path, log: RaceLog, said: str) -> None:
    path = tmp_path / "race.mcap"
    write_recording(path, log)
    with pytest.raises(InputError, match=said):
        read_recording(path)
    with pytest.raises(InputError, match="nothing can be recovered"):
        recover_recording(path)


def packed(
    path: Path,
    ticks: list[bytes],
    compression: CompressionType = CompressionType.ZSTD,
    teams: tuple[int, ...] = LOG.teams,
) -> None:
    """A recording whose checksums hold, of some messages of cars as they are."""
    with path.open("wb") as file:
        writer = Writer(file, 1 << 20, compression, enable_data_crcs=True)
        writer.start()
        race = recording_module._race_message(LOG)
        race.teams[:] = teams
        channels = [
            writer.register_channel(topic, "protobuf", register_schema(writer, kind))
            for topic, kind in (("/race", pb.Race), ("/cars", pb.CarStates))
        ]
        writer.add_message(channels[0], 0, race.SerializeToString(), 0)
        for tick in ticks:
            writer.add_message(channels[1], 0, tick, 0)
        writer.finish()  # type: ignore[no-untyped-call]


CAR_OF_NO_BYTES = b"\x12\x00"


@pytest.mark.parametrize(
    ("ticks", "said"),
    [
        ([CAR_OF_NO_BYTES * 1_000_000], "is too large"),
        ([CAR_OF_NO_BYTES * 30_000] * 200, "longer than any race"),
        ([bytes(40 << 20)], "unpacks to more"),
    ],
)
def test_small_files_that_hold_more_than_memory_are_refused(
    tmp_path: Path, ticks: list[bytes], said: str
) -> None:
    path = tmp_path / "bomb.mcap"
    packed(path, ticks)
    assert path.stat().st_size < 100_000
    with pytest.raises(InputError, match=said):
        read_recording(path)


def test_a_chunk_that_says_less_than_it_unpacks_to_is_refused(tmp_path: Path, whole: bytes) -> None:
    frame = whole.index(struct.pack("<I", 0xFD2FB528))
    # A header of one segment with a size of eight bytes: 1 TiB.
    data = bytearray(whole)
    data[frame + 4 : frame + 13] = b"\xe0" + struct.pack("<Q", 1 << 40)
    path = tmp_path / "bomb.mcap"
    path.write_bytes(sealed(bytes(data)))
    with pytest.raises(InputError, match="unpacks to more"):
        read_recording(path)


def test_other_compression_is_refused(tmp_path: Path) -> None:
    packed(tmp_path / "lz4.mcap", [CAR_OF_NO_BYTES * 3], CompressionType.LZ4)
    with pytest.raises(InputError, match="packed by 'lz4', expected 'zstd'"):
        read_recording(tmp_path / "lz4.mcap")


def test_unknown_teams_are_refused(tmp_path: Path) -> None:
    packed(tmp_path / "teams.mcap", [], teams=(7, 0, 1))
    with pytest.raises(InputError, match="field teams names an unknown team"):
        read_recording(tmp_path / "teams.mcap")
