"""Recordings give back what was written, refuse what was not, and can be read without nathlon."""

from __future__ import annotations

import io
import struct
import subprocess
import sys
import zlib
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.message import Message
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.well_known import MessageEncoding
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory
from mcap_protobuf.schema import register_schema

from nathlon.arena import _car_state_pb2 as pb
from nathlon.arena import recording as recording_module
from nathlon.arena.race_log import CAR_SAMPLE, Incident, Outline, RaceLog
from nathlon.arena.recording import OUTLINE_LINES, read_recording, recover_recording, write_recording
from nathlon.sim.errors import InputError
from tests.support.race_logs import oval_race, road_axes, turned

RERUN = Path(sys.executable).with_name("rerun")
POINT = pb.Polyline(x_m=[1.0], y_m=[1.0], z_m=[1.0])
TOPICS = ("/race", "/scene", "/cars", "/transforms", "/incidents", "/log")


def assert_same(read: RaceLog, written: RaceLog) -> None:
    for field in fields(RaceLog):
        a, b = getattr(read, field.name), getattr(written, field.name)
        if field.name == "outline":
            for line in fields(Outline):
                np.testing.assert_array_equal(getattr(a, line.name), getattr(b, line.name))
        elif isinstance(b, np.ndarray):
            assert (a.dtype, a.shape) == (b.dtype, b.shape)
            assert a.tobytes() == b.tobytes()
        else:
            assert a == b, field.name


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("recording") / "race.mcap"
    write_recording(path, oval_race(cars=2, duration_s=3.0))
    return path.read_bytes()


def sealed(path: Path, messages: list[tuple[str, Message]]) -> None:
    """An MCAP file whose checksums hold, with these messages."""
    with path.open("wb") as file:
        writer = Writer(file, enable_data_crcs=True)
        writer.start()
        for topic, message in messages:
            channel = writer.register_channel(
                topic, MessageEncoding.Protobuf, register_schema(writer, type(message))
            )
            writer.add_message(channel, 0, message.SerializeToString(), 0)
        writer.finish()  # type: ignore[no-untyped-call]


def one_point_race(runoff_right: list[int], lane: Sequence[int] = ()) -> pb.Race:
    """A race whose circuit is one point."""
    race = pb.Race(runoff_left=[0], runoff_right=runoff_right, zone=[False], lane=lane)
    for line in OUTLINE_LINES:
        getattr(race, line).CopyFrom(POINT)
    return race


def test_a_race_reads_back_bit_for_bit(tmp_path: Path) -> None:
    log = oval_race(cars=8, duration_s=20.0)
    write_recording(tmp_path / "race.mcap", log)
    assert_same(read_recording(tmp_path / "race.mcap"), log)
    assert [entry.name for entry in tmp_path.iterdir()] == ["race.mcap"]


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_any_samples_and_incidents_read_back_bit_for_bit(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    log = oval_race(cars=data.draw(st.integers(1, 3)), duration_s=0.3)
    ticks = data.draw(st.integers(0, 3))
    samples = log.samples[:ticks].copy()
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    for name in CAR_SAMPLE.names or ():
        kind = CAR_SAMPLE[name]
        if kind == np.bool_:
            samples[name] = rng.random(samples.shape) < 0.5
        elif kind.kind == "i":
            samples[name] = rng.integers(-(2**23), 2**23, samples.shape)
        else:
            samples[name] = rng.choice([0.0, -0.0, 1e-38, -1e6, np.pi], samples.shape)
    samples["place"] = rng.integers(1, len(log.names) + 1, samples.shape)
    incidents = st.builds(
        Incident,
        time_s=st.floats(0, 1e5),
        kind=st.sampled_from(["contact", "wall", "off_course", "ending"]),
        cars=st.lists(st.integers(0, len(log.names) - 1), min_size=1).map(tuple),
        text=st.text(st.characters(codec="utf-8")),
    )
    log = replace(
        log,
        time_s=log.time_s[:ticks],
        samples=samples,
        seed=data.draw(st.integers(-(2**63), 2**63 - 1)),
        names=tuple(data.draw(st.text(st.characters(codec="utf-8"))) for _ in log.names),
        teams=tuple(data.draw(st.sampled_from([-1, 0, 1])) for _ in log.names),
        incidents=tuple(data.draw(st.lists(incidents, max_size=4))),
    )
    path = tmp_path_factory.mktemp("any") / "race.mcap"
    write_recording(path, log)
    assert_same(read_recording(path), log)


def test_the_same_race_gives_the_same_bytes(tmp_path: Path, recording: bytes) -> None:
    write_recording(tmp_path / "again.mcap", oval_race(cars=2, duration_s=3.0))
    assert (tmp_path / "again.mcap").read_bytes() == recording


@given(data=st.data())
@settings(max_examples=200, deadline=None)
def test_a_cut_or_changed_file_is_refused(
    data: st.DataObject, recording: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.mcap"
    at = data.draw(st.integers(0, len(recording) - 1))
    flip = data.draw(st.integers(0, 255))
    damaged = recording[:at] + bytes([recording[at] ^ flip]) + recording[at + 1 :] if flip else recording[:at]
    path.write_bytes(damaged)
    with pytest.raises(InputError, match=r"damaged\.mcap"):
        read_recording(path)


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> tuple[RaceLog, bytes]:
    """A race that takes several chunks, and its recording."""
    log = oval_race(cars=8, duration_s=60.0)
    path = tmp_path_factory.mktemp("long") / "race.mcap"
    write_recording(path, log)
    return log, path.read_bytes()


@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_what_stands_before_the_damage_is_recovered(
    data: st.DataObject, long: tuple[RaceLog, bytes], tmp_path_factory: pytest.TempPathFactory
) -> None:
    log, content = long
    path = tmp_path_factory.getbasetemp() / "hurt.mcap"
    at = data.draw(st.integers(0, len(content) - 1))
    bit = data.draw(st.integers(-1, 7))
    rest = b"" if bit < 0 else bytes([content[at] ^ 1 << bit]) + content[at + 1 :]
    path.write_bytes(content[:at] + rest)
    try:
        found = recover_recording(path)
    except InputError:
        assert at < 160_000, "the first chunk was whole"
        return
    ticks = len(found.log.time_s)
    assert not found.whole
    assert found.log.samples.tobytes() == log.samples[:ticks].tobytes()
    assert ticks >= len(log.time_s) * (at / len(content) - 0.35)
    own = 1 + ticks + len(found.log.incidents)  # each followed by one of Foxglove's: a chunk may end between
    assert found.messages in (2 * own - 1, 2 * own)
    assert found.log.incidents == log.incidents[: len(found.log.incidents)]
    write_recording(path, found.log)
    assert_same(read_recording(path), found.log)


def test_what_holds_no_sample_cannot_be_recovered(tmp_path: Path, recording: bytes) -> None:
    for name, content, fault in (
        ("text", b"lap,time", "is not an MCAP file"),
        ("cut", recording[:400], "nothing can be recovered"),
        ("magic", recording[:8], "nothing can be recovered"),
    ):
        (tmp_path / f"{name}.mcap").write_bytes(content)
        with pytest.raises(InputError, match=rf"{name}\.mcap.*{fault}"):
            recover_recording(tmp_path / f"{name}.mcap")


def test_of_a_whole_file_nothing_is_lost(tmp_path: Path, recording: bytes) -> None:
    (tmp_path / "race.mcap").write_bytes(recording)
    found = recover_recording(tmp_path / "race.mcap")
    assert found.whole
    assert_same(found.log, oval_race(cars=2, duration_s=3.0))


def test_every_byte_of_the_end_is_guarded(tmp_path: Path, recording: bytes) -> None:
    path = tmp_path / "damaged.mcap"
    for back in range(1, 60):
        damaged = bytearray(recording)
        damaged[-back] ^= 1
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"damaged\.mcap"):
            read_recording(path)


def test_what_is_not_a_file_of_ours_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.mcap: cannot read the recording: No such file"):
        read_recording(tmp_path / "nowhere.mcap")
    with pytest.raises(InputError, match="cannot read the recording: Is a directory"):
        read_recording(tmp_path)
    (tmp_path / "empty.mcap").write_bytes(b"")
    (tmp_path / "text.mcap").write_text("lap,time\n1,90.2\n")
    for name in ("empty.mcap", "text.mcap"):
        with pytest.raises(InputError, match=f"{name} is not an MCAP file"):
            read_recording(tmp_path / name)
    with (tmp_path / "bare.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(InputError, match=r"bare\.mcap is cut short or damaged"):
        read_recording(tmp_path / "bare.mcap")


@pytest.mark.parametrize(
    ("messages", "fault"),
    [
        ([], "topic /race holds 0 messages"),
        ([("/race", pb.Race()), ("/race", pb.Race())], "topic /race holds 2 messages"),
        ([("/race", pb.Incident())], "topic /race is of another schema"),
        ([("/race", pb.Race(names=["a", "b"], teams=[0]))], "field teams names 1 cars, expected 2"),
        ([("/race", pb.Race()), ("/cars", pb.CarStates(cars=[pb.CarState()]))], "a tick without 0 cars"),
        ([("/race", pb.Race()), ("/incidents", pb.Incident(cars=[0]))], "names a car that is not among"),
        (
            [("/race", pb.Race(centre=pb.Polyline(x_m=[1.0])))],
            r"field centre has \[1, 0, 0\] of x_m, y_m and z",
        ),
        (
            [("/race", pb.Race(kerb_left=POINT))],
            "field kerb_left has 1 points, expected as many as centre",
        ),
        ([("/race", pb.Race(runoff_left=[2]))], "field runoff_left has 1 points"),
        ([("/race", one_point_race(runoff_right=[4]))], "field runoff_right names an unknown surface"),
        ([("/race", one_point_race([0], lane=[2]))], "field lane names an unknown side"),
        ([("/race", one_point_race([0], lane=[0, 1]))], "field lane has 2 points"),
    ],
)
def test_whole_files_of_other_contents_are_refused(
    tmp_path: Path, messages: list[tuple[str, Message]], fault: str
) -> None:
    sealed(tmp_path / "foreign.mcap", messages)
    with pytest.raises(InputError, match=rf"foreign\.mcap is not a recording.*{fault}"):
        read_recording(tmp_path / "foreign.mcap")


def test_earlier_recordings_have_no_pit_lane() -> None:
    assert recording_module._outline(one_point_race([0])).lane.tolist() == [0]


def test_a_chunk_that_cannot_be_unpacked_is_refused(tmp_path: Path, recording: bytes) -> None:
    path = tmp_path / "packed.mcap"
    content = bytearray(recording)
    frame = content.index(struct.pack("<I", 0xFD2FB528))
    content[frame + 20 : frame + 40] = bytes(20)
    (summary_start,) = struct.unpack_from("<Q", content, len(content) - 28)
    struct.pack_into("<I", content, summary_start - 4, zlib.crc32(content[: summary_start - 13]))
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"packed\.mcap is not a recording"):
        read_recording(path)


def test_the_schemas_in_the_file_are_enough_to_read_it(recording: bytes) -> None:
    log = oval_race(cars=2, duration_s=3.0)
    reader = make_reader(io.BytesIO(recording), validate_crcs=True, decoder_factories=[DecoderFactory()])
    messages: dict[str, list] = {}
    for _, channel, record, message in reader.iter_decoded_messages():
        messages.setdefault(channel.topic, []).append((record.log_time, message))

    assert len(messages["/cars"]) == len(messages["/transforms"]) == len(log.time_s)
    assert [time_ns for time_ns, _ in messages["/cars"]] == [100_000_000 * tick for tick in range(30)]
    last = messages["/cars"][-1][1].cars[1]
    for name in CAR_SAMPLE.names or ():
        assert getattr(last, name) == log.samples[name][-1, 1]

    frame = messages["/transforms"][7][1].transforms[1]
    sample = log.samples[7, 1]
    assert (frame.parent_frame_id, frame.child_frame_id) == ("world", "car_1")
    at = frame.translation
    assert (at.x, at.y, at.z) == (sample["x_m"], sample["y_m"], sample["z_m"])
    turn = np.array([getattr(frame.rotation, part) for part in "xyzw"])
    along, up = road_axes(sample["distance_m"], sample["yaw_rad"])
    np.testing.assert_allclose(turned(turn, (1.0, 0.0, 0.0)), along, atol=1e-6)
    np.testing.assert_allclose(turned(turn, (0.0, 0.0, 1.0)), up, atol=1e-6)
    assert frame.timestamp.ToNanoseconds() == 700_000_000

    (scene,) = (message for _, message in messages["/scene"])
    assert [entity.frame_id for entity in scene.entities] == ["world", "car_0", "car_1"]
    assert [entity.frame_locked for entity in scene.entities] == [False, True, True]
    assert [(time_ns, entry.message) for time_ns, entry in messages["/log"]] == [
        (round(incident.time_s * 1e9), incident.text) for incident in log.incidents
    ]


def test_rerun_finds_no_fault(tmp_path: Path, recording: bytes) -> None:
    path = tmp_path / "race.mcap"
    path.write_bytes(recording)
    check = subprocess.run(
        [RERUN, "mcap", "check", "--full", path], capture_output=True, text=True, check=True
    )
    lines = [line.split() for line in check.stdout.splitlines()]
    states = {line[3]: line[0] for line in lines if len(line) == 5 and line[3] != "Topic"}
    assert states == dict.fromkeys(TOPICS, "ok"), check.stdout
