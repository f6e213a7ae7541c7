"""Race recordings: MCAP files of protobuf messages that Foxglove and Rerun open, and that read back exactly.

Topics: `/race`, `/cars` and `/incidents` carry all of a race log in messages of our own (car_state.proto);
`/scene`, `/transforms` and `/log` show it in Foxglove's (https://docs.foxglove.dev/docs/sdk/schemas).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import Message
from mcap.records import Channel, Metadata, Schema
from mcap.records import Message as Record
from mcap.well_known import MessageEncoding
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema
from numpy.typing import NDArray

from nathlon.arena import _car_state_pb2 as pb
from nathlon.arena.foxglove_scene import scene
from nathlon.arena.mcap_file import FAULTS, checksums_match, is_schema_of, read_content, records
from nathlon.arena.protobuf_rows import Rows, encode
from nathlon.arena.race_log import CAR_SAMPLE, NOTICES, Incident, NamedStretch, Outline, RaceLog, orientation
from nathlon.arena.recorded_race import check_race
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.errors import InputError
from nathlon.sim.process import typed
from nathlon.sim.track import SURFACES
from nathlon.sim.whole_file import whole_file

OWN_MESSAGES: dict[str, type[Message]] = {"/race": pb.Race, "/cars": pb.CarStates, "/incidents": pb.Incident}
OUTLINE_LINES = ("left", "centre", "right", "kerb_left", "kerb_right", "wall_left", "wall_right")
OUTLINE_ROWS = ("runoff_left", "runoff_right", "zone", "lane")
FACTS = ("circuit", "car", "scenario", "seed", "match", "race", "version", "car_length_m", "car_width_m")

CAMERAS = "nathlon.cameras"
"""Metadata record that says by which cameras drivers saw, by car; only where somebody did."""
CHUNK_BYTES = 256 * 1024
"""Of messages, before they are packed: what a damaged file loses at most, some ten seconds of a race."""
NANO = 1_000_000_000
SMALLEST_TURN = 2.0**-22
"""To which frames are rounded, which only viewers use: unrounded ones would make files a quarter larger."""
MOST_MESSAGES = 1_000_000
MOST_SAMPLES = 4_500_000
"""Messages, and samples of cars, after which reading stops."""
LARGEST_MESSAGE = {"/race": 32 << 20, "/cars": 1 << 16, "/incidents": 1 << 16}
"""Bytes by topic; a message takes a hundred times as much once it is read."""


class Recovery(NamedTuple):
    """What a damaged recording still held.

    Attributes:
        log: the race until then.
        messages: how many there were, in all topics.
        whole: whether nothing was missing.
    """

    log: RaceLog
    messages: int
    whole: bool


def recording_name(match: str, race: int) -> str:
    """The file name of the recording of one of a match's races."""
    return f"{match[:10]}-{race}.mcap"


def write_recording(path: Path, log: RaceLog) -> None:
    """Write a race log as MCAP. The same log gives the same bytes; a file of that name is replaced whole."""
    with whole_file(path) as partial, partial.open("wb") as file:
        _write_messages(Writer(file, CHUNK_BYTES, enable_data_crcs=True), log)


def read_recording(path: Path) -> RaceLog:
    """The race log that `write_recording` wrote.

    Raises InputError if the file is not there, is not a nathlon recording, or differs in any byte from what
    was written.
    """
    content = read_content(path)
    if not checksums_match(content):
        raise InputError(
            f"{path} is cut short or damaged: its checksums do not match its contents "
            f"({typed('replay', '--recover', path)} saves what can be read)."
        )
    try:
        cameras: dict[int, CameraSpec] = {}
        return _race_log([one for one in _messages(content, cameras) if one is not None], cameras)
    except FAULTS as error:
        raise InputError(f"{path} is not a recording of this version of nathlon: {error}.") from error


def recover_recording(path: Path) -> Recovery:
    """The race in a recording that is cut short or damaged, up to the first place that cannot be read.

    Raises InputError if the file is not there, is not a nathlon recording, or is damaged before the first
    sample.
    """
    content = read_content(path)
    own: list[Message] = []
    cameras: dict[int, CameraSpec] = {}
    count, fault = 0, "it holds no sample"
    try:
        for message in _messages(content, cameras):
            count += 1
            if message is not None:
                own.append(message)
    except FAULTS as error:
        fault = str(error) or type(error).__name__
    if not any(isinstance(message, pb.CarStates) for message in own):
        raise InputError(f"{path}: nothing can be recovered: {fault}.")
    try:
        return Recovery(_race_log(own, cameras), count, checksums_match(content))
    except ValueError as error:
        raise InputError(f"{path}: nothing can be recovered: {error}.") from error


def _write_messages(writer: Writer, log: RaceLog) -> None:
    writer.start(library="nathlon")
    if any(log.cameras):
        writer.add_metadata(
            CAMERAS,
            {str(car): json.dumps(camera.to_dict()) for car, camera in enumerate(log.cameras) if camera},
        )
    channels: dict[str, int] = {}

    def write(topic: str, kind: type[Message], content: bytes, time_s: float) -> None:
        if topic not in channels:
            schema_id = register_schema(writer, kind)
            channels[topic] = writer.register_channel(topic, MessageEncoding.Protobuf, schema_id)
        time_ns = round(time_s * NANO)
        writer.add_message(channels[topic], time_ns, content, time_ns)

    def add(topic: str, message: Message, time_s: float) -> None:
        write(topic, type(message), message.SerializeToString(), time_s)

    start_s = float(log.time_s[0]) if len(log.time_s) else 0.0
    add("/race", _race_message(log), start_s)
    add("/scene", scene(log), start_s)
    incidents = list(log.incidents)
    for time_s, states, transforms in zip(log.time_s.tolist(), _states(log), _transforms(log), strict=True):
        while incidents and incidents[0].time_s <= time_s:
            incident = incidents.pop(0)
            add("/incidents", _incident_message(incident), incident.time_s)
            add("/log", _log_message(incident), incident.time_s)
        write("/cars", pb.CarStates, states.tobytes(), time_s)
        write("/transforms", FrameTransforms, transforms.tobytes(), time_s)
    for incident in incidents:
        add("/incidents", _incident_message(incident), incident.time_s)
        add("/log", _log_message(incident), incident.time_s)
    writer.finish()  # type: ignore[no-untyped-call]


def _race_message(log: RaceLog) -> pb.Race:
    message = pb.Race(names=log.names, teams=log.teams)
    for fact in FACTS:
        setattr(message, fact, getattr(log, fact))
    for name in OUTLINE_LINES:
        points = getattr(log.outline, name)
        line = getattr(message, name)
        for axis, values in enumerate((line.x_m, line.y_m, line.z_m)):
            values.extend(points[:, axis].tolist())
    for name in OUTLINE_ROWS:
        getattr(message, name).extend(getattr(log.outline, name).tolist())
    message.sections.extend(pb.Stretch(**vars(section)) for section in log.sections)
    return message


def _incident_message(incident: Incident) -> pb.Incident:
    return pb.Incident(**vars(incident))


def _log_message(incident: Incident) -> Log:
    level = Log.Level.INFO if incident.kind in NOTICES else Log.Level.WARNING
    message = Log(level=level, name=incident.kind, message=incident.text)
    message.timestamp.FromNanoseconds(round(incident.time_s * NANO))
    return message


def _states(log: RaceLog) -> Rows:
    """What `/cars` says at each tick."""
    cars = [
        {name: log.samples[name][:, car] for name in CAR_SAMPLE.names or ()} for car in range(len(log.names))
    ]
    return encode(pb.CarStates.DESCRIPTOR, {"time_s": log.time_s, "cars": cars}, len(log.time_s))


def _transforms(log: RaceLog) -> Rows:
    """What `/transforms` says at each tick."""
    samples = log.samples
    exact = orientation(samples["yaw_rad"], samples["pitch_rad"], samples["roll_rad"])
    turns = np.round(exact / SMALLEST_TURN) * SMALLEST_TURN
    nanos = np.rint(log.time_s * NANO).astype(np.int64)
    timestamp = {"seconds": nanos // NANO, "nanos": nanos % NANO}
    frames = [
        {
            "timestamp": timestamp,
            "parent_frame_id": "world",
            "child_frame_id": f"car_{car}",
            "translation": {axis: samples[f"{axis}_m"][:, car] for axis in "xyz"},
            "rotation": {axis: turns[:, car, index] for index, axis in enumerate("xyzw")},
        }
        for car in range(len(log.names))
    ]
    return encode(FrameTransforms.DESCRIPTOR, {"transforms": frames}, len(log.time_s))


def _messages(content: bytes, cameras: dict[int, CameraSpec]) -> Iterator[Message | None]:
    """All messages in the file's order; None stands for one of Foxglove's. Fills in the cameras by car."""
    schemas: dict[int, Schema] = {}
    types: dict[int, tuple[type[Message], int]] = {}
    count = samples = 0
    for record in records(content):
        if isinstance(record, Metadata) and record.name == CAMERAS:
            for car, camera in record.metadata.items():
                cameras[int(car)] = _camera(camera)
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel) and record.topic in OWN_MESSAGES:
            message_type = OWN_MESSAGES[record.topic]
            if not is_schema_of(message_type, schemas[record.schema_id]):
                raise ValueError(f"topic {record.topic} is of another schema")
            types[record.id] = message_type, LARGEST_MESSAGE[record.topic]
        elif isinstance(record, Record):
            count += 1
            message = None
            if record.channel_id in types:
                message_type, largest = types[record.channel_id]
                if len(record.data) > largest:
                    raise ValueError(f"a message of {message_type.DESCRIPTOR.full_name} is too large")
                message = message_type.FromString(record.data)
            if isinstance(message, pb.CarStates):
                samples += len(message.cars)
            if count > MOST_MESSAGES or samples > MOST_SAMPLES:
                raise ValueError("it is longer than any race")
            yield message


def _camera(text: str) -> CameraSpec:
    try:
        return CameraSpec.from_dict(json.loads(text))
    except InputError as error:
        raise ValueError(str(error)) from None


def _race_log(messages: list[Message], cameras: dict[int, CameraSpec]) -> RaceLog:
    """Raises ValueError if the messages do not make up one race."""
    races = [message for message in messages if isinstance(message, pb.Race)]
    ticks = [message for message in messages if isinstance(message, pb.CarStates)]
    incidents = [message for message in messages if isinstance(message, pb.Incident)]
    if len(races) != 1:
        raise ValueError(f"topic /race holds {len(races)} messages, expected one")
    race, cars = races[0], len(races[0].names)
    if len(race.teams) != cars:
        raise ValueError(f"field teams names {len(race.teams)} cars, expected {cars}")
    if any(len(tick.cars) != cars for tick in ticks):
        raise ValueError(f"topic /cars holds a tick without {cars} cars")
    if not set(cameras) <= set(range(cars)):
        raise ValueError(f"the cameras name a car that is not among the {cars}")
    if any(car >= cars for incident in incidents for car in incident.cars):
        raise ValueError(f"topic /incidents names a car that is not among the {cars}")
    samples = np.zeros((len(ticks), cars), CAR_SAMPLE)
    values = attrgetter(*(CAR_SAMPLE.names or ()))
    for tick, message in enumerate(ticks):
        samples[tick] = [values(state) for state in message.cars]
    log = RaceLog(
        **{fact: getattr(race, fact) for fact in FACTS},
        names=tuple(race.names),
        teams=tuple(race.teams),
        outline=_outline(race),
        sections=tuple(NamedStretch(s.name, s.kind, s.start_m, s.end_m) for s in race.sections),
        time_s=np.array([tick.time_s for tick in ticks], np.float64),
        samples=samples,
        incidents=tuple(
            Incident(i.time_s, i.kind, tuple(i.cars), i.text, i.fault, i.closing_m_s, i.penalty_s)
            for i in incidents
        ),
        cameras=tuple(cameras.get(car) for car in range(cars)) if cameras else (),
    )
    check_race(log)
    return log


def _outline(race: pb.Race) -> Outline:
    lines = {name: _polyline(name, getattr(race, name)) for name in OUTLINE_LINES}
    runoff = {name: np.array(getattr(race, name), np.int64) for name in ("runoff_left", "runoff_right")}
    zone = np.array(race.zone, np.bool_)
    # Earlier recordings know no pit lane.
    lane = np.array(race.lane or [0] * len(lines["centre"]), np.int64)
    for name, values in (lines | runoff | {"zone": zone, "lane": lane}).items():
        if len(values) != len(lines["centre"]):
            raise ValueError(
                f"field {name} has {len(values)} points, expected as many as centre, {len(lines['centre'])}"
            )
    for name, values in runoff.items():
        if not np.isin(values, np.arange(len(SURFACES))).all():
            raise ValueError(f"field {name} names an unknown surface, expected 0 to {len(SURFACES) - 1}")
    if not np.isin(lane, (-1, 0, 1)).all():
        raise ValueError("field lane names an unknown side, expected -1, 0 or 1")
    left, right = runoff["runoff_left"], runoff["runoff_right"]
    return Outline(**lines, runoff_left=left, runoff_right=right, zone=zone, lane=lane)


def _polyline(name: str, line: pb.Polyline) -> NDArray[np.float64]:
    axes = (line.x_m, line.y_m, line.z_m)
    if len({len(axis) for axis in axes}) != 1:
        counts = [len(axis) for axis in axes]
        raise ValueError(f"field {name} has {counts} of x_m, y_m and z_m, expected as many of each")
    return np.stack([np.array(axis, np.float64) for axis in axes], axis=1)
