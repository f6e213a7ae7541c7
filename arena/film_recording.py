"""Films as MCAP files of compressed images, which Foxglove and Rerun play.

The topic `/pictures` has one `foxglove.CompressedImage` a picture
(https://docs.foxglove.dev/docs/sdk/schemas/compressed-image); a metadata record says which episode it is.
"""

from __future__ import annotations

import io
import json
from pathlib import Path

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from mcap.records import Channel, Message, Metadata, Schema
from mcap.well_known import MessageEncoding
from mcap.writer import MCAP0_MAGIC, Writer
from mcap_protobuf.schema import register_schema
from PIL import Image, UnidentifiedImageError

from nathlon.arena.film import MOST_PICTURES, SIDE, Film
from nathlon.arena.mcap_file import FAULTS, checksums_match, is_schema_of, read_content, records
from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import open_regular
from nathlon.sim.whole_file import whole_file

PROFILE = "x-nathlon-episode"
"""In the header of the file, which tells films from races."""
TOPIC = "/pictures"
FACTS = ("world", "scenario", "match", "race", "seed", "version", "note")
CHUNK_BYTES = 1 << 20


def write_film(path: Path, film: Film) -> None:
    """Write a film as MCAP. The same film gives the same bytes; a file of that name is replaced whole."""
    facts = {name: str(getattr(film, name)) for name in FACTS}
    with whole_file(path) as partial, partial.open("wb") as file:
        writer = Writer(file, CHUNK_BYTES, enable_data_crcs=True)
        writer.start(PROFILE, library="nathlon")
        writer.add_metadata(PROFILE, {**facts, "seats": json.dumps(film.seats)})
        schema = register_schema(writer, CompressedImage)
        channel = writer.register_channel(TOPIC, MessageEncoding.Protobuf, schema)
        for time_s, picture in zip(film.time_s, film.pictures, strict=True):
            time_ns = round(time_s * 1e9)
            image = CompressedImage(frame_id="camera", data=picture, format="jpeg")
            image.timestamp.FromNanoseconds(time_ns)
            writer.add_message(channel, time_ns, image.SerializeToString(), time_ns)
        writer.finish()  # type: ignore[no-untyped-call]


def holds_film(path: Path) -> bool:
    """Whether a file begins as those of `write_film` do.

    Raises:
        InputError: if it cannot be opened.
    """
    with open_regular(path, "recording") as file:
        head = file.read(len(MCAP0_MAGIC) + 64)
    return head.startswith(MCAP0_MAGIC) and PROFILE.encode() in head


def read_film(path: Path) -> Film:
    """The film that `write_film` wrote.

    Raises:
        InputError: if the file is not there, holds no film, or differs in any byte from what was written.
    """
    content = read_content(path)
    if not checksums_match(content):
        raise InputError(f"{path} is cut short or damaged: its checksums do not match its contents.")
    try:
        return _film(content)
    except FAULTS as error:
        raise InputError(f"{path} is not a film of this version of nathlon: {error}.") from error


def _film(content: bytes) -> Film:
    """Raises one of FAULTS if the messages do not make up a film."""
    schemas: dict[int, Schema] = {}
    channels: set[int] = set()
    facts: dict[str, str] = {}
    time_s: list[float] = []
    pictures: list[bytes] = []
    for record in records(content):
        if isinstance(record, Metadata) and record.name == PROFILE:
            facts = record.metadata
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel) and record.topic == TOPIC:
            if not is_schema_of(CompressedImage, schemas[record.schema_id]):
                raise ValueError(f"topic {TOPIC} is of another schema")
            channels.add(record.id)
        elif isinstance(record, Message) and record.channel_id in channels:
            pictures.append(CompressedImage.FromString(record.data).data)
            time_s.append(record.log_time / 1e9)
            _check(pictures, time_s)
    if not pictures:
        raise ValueError("it has no picture")
    return Film(
        world=facts["world"],
        scenario=facts["scenario"],
        match=facts["match"],
        race=int(facts["race"]),
        seed=int(facts["seed"]),
        version=facts["version"],
        note=facts["note"],
        seats=tuple((str(seat), str(who)) for seat, who in json.loads(facts["seats"])),
        time_s=tuple(time_s),
        pictures=tuple(pictures),
    )


def _check(pictures: list[bytes], time_s: list[float]) -> None:
    """Whether the last picture can follow those before."""
    if len(pictures) > MOST_PICTURES:
        raise ValueError(f"it has more than {MOST_PICTURES:,} pictures")
    if len(time_s) > 1 and time_s[-1] <= time_s[-2]:
        raise ValueError("its times do not increase")
    try:
        with Image.open(io.BytesIO(pictures[-1]), formats=["JPEG"]) as image:
            size = image.size
    except UnidentifiedImageError:
        raise ValueError("a picture is no JPEG") from None
    if max(size) > SIDE:
        raise ValueError(f"a picture has {size} pixels, expected at most {SIDE}")
