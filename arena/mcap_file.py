"""MCAP files of ours, read without trust: whole ones only, and no more of them than can sensibly be."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

from google.protobuf.message import DecodeError, Message
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, McapRecord, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from mcap_protobuf.schema import build_file_descriptor_set
from zstandard import ZstdError, frame_content_size

from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import read_bytes

DATA_END = struct.Struct("<BQI")  # opcode, length, CRC of all that stands before it
FOOTER = struct.Struct(
    "<BQQQI"
)  # opcode, length, where the summary and its offsets start, CRC of the summary
LARGEST_MIB = 256
"""Of a recording; one of a race of six hours between twenty cars has some 200."""
LARGEST_CHUNK = 32 << 20
LARGEST_UNPACKED = 1 << 30
"""Bytes of a chunk and of all together, after which reading stops: a small file can hold more than any
memory."""
FAULTS = (McapError, DecodeError, ZstdError, ValueError, KeyError, struct.error, AttributeError)
"""What reading raises where a file is not as it should be."""


def read_content(path: Path) -> bytes:
    """The bytes of an MCAP file.

    Raises:
        InputError: if there is no such file, it is too large, or no MCAP file.
    """
    content = read_bytes(path, LARGEST_MIB, "recording")
    if not content.startswith(MCAP0_MAGIC):
        raise InputError(f"{path} is not an MCAP file: expected a recording that nathlon wrote.")
    return content


def checksums_match(content: bytes) -> bool:
    """Whether an MCAP file ends with a checksum of its data and one of its summary, and both hold.

    The `mcap` reader checks the data only, and only while it finds its end; see https://mcap.dev/spec.
    """
    footer_start = len(content) - len(MCAP0_MAGIC) - FOOTER.size
    if footer_start < 0 or not content.endswith(MCAP0_MAGIC):
        return False
    *_, summary_start, _, summary_crc = FOOTER.unpack_from(content, footer_start)
    data_end = summary_start - DATA_END.size
    if not 0 <= data_end < footer_start:
        return False
    opcode, length, data_crc = DATA_END.unpack_from(content, data_end)
    return (
        (opcode, length) == (Opcode.DATA_END, 4)
        and data_crc == zlib.crc32(content[:data_end])
        and summary_crc == zlib.crc32(content[summary_start : -len(MCAP0_MAGIC) - 4])
    )


def records(content: bytes) -> Iterator[McapRecord]:
    """All records in the file's order, those in its chunks in their place.

    Raises:
        one of FAULTS: where the file is not as it should be.
    """
    unpacked = 0
    for record in StreamReader(io.BytesIO(content), emit_chunks=True, validate_crcs=True).records:
        if not isinstance(record, Chunk):
            yield record
            continue
        if record.compression != "zstd":
            raise ValueError(f"a chunk is packed by {record.compression!r}, expected 'zstd'")
        # The reader believes what the packed data say of themselves.
        size = max(record.uncompressed_size, frame_content_size(record.data))
        unpacked += size
        if size > LARGEST_CHUNK or unpacked > LARGEST_UNPACKED:
            raise ValueError("a chunk unpacks to more than any recording holds")
        yield from breakup_chunk(record, validate_crc=True)


def is_schema_of(message_type: type[Message], schema: Schema) -> bool:
    """Whether the schema is to the byte the one written today: a field by another name would read as zero."""
    return (schema.name, schema.data) == (
        message_type.DESCRIPTOR.full_name,
        build_file_descriptor_set(message_type).SerializeToString(),
    )
