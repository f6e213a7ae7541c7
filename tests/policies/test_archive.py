"""Zip archives: unpacked as they are, and never beyond what they say or may."""

from __future__ import annotations

import io
import struct
import tracemalloc
import warnings
import zipfile
from pathlib import Path

import pytest

from nathlon.policies.sources import archive
from nathlon.policies.sources.archive import unpack


def pack(path: Path, members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> None:
    with zipfile.ZipFile(path, "w", method) as written:
        for name, content in members.items():
            written.writestr(name, content)


def packed(members: list[tuple[str, bytes]], method: int = zipfile.ZIP_DEFLATED) -> bytearray:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", method) as written, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, member in members:
            written.writestr(name, member)
    return bytearray(content.getvalue())


def claim(content: bytearray, place: int, value: int) -> bytes:
    """The archive with another number `place` bytes into the first entry of its table of contents."""
    struct.pack_into("<I", content, content.index(b"PK\x01\x02") + place, value)
    return bytes(content)


FLAGS, SIZE = 8, 24
MEMBERS = [("a", bytes(1000)), ("folder/b", b"text"), ("c", b"")]


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_members_are_unpacked(method: int) -> None:
    content = bytes(packed(MEMBERS, method))
    assert unpack(content) == dict(MEMBERS)
    assert unpack(content, ("c", "a", "z")) == {"a": bytes(1000), "c": b""}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "not a zip"),
        (bytes(packed(MEMBERS))[:-9], "not a zip"),
        (packed([("a", b"1"), ("a", b"2")]), "stands for two members"),
        (packed(MEMBERS, zipfile.ZIP_BZIP2), "packed in an unusual way"),
        (packed(MEMBERS, zipfile.ZIP_LZMA), "packed in an unusual way"),
        (claim(packed(MEMBERS), FLAGS, 1), "encrypted"),
        (claim(packed(MEMBERS), SIZE, 999), "CRC"),
        (claim(packed(MEMBERS), SIZE, 1001), "is cut off"),
        (claim(packed(MEMBERS), SIZE, 1 << 30), "unpacks to more than"),
    ],
)
def test_other_archives_are_refused(content: bytes, said: str) -> None:
    with pytest.raises(zipfile.BadZipFile, match=said):
        unpack(bytes(content))


def test_a_member_is_stopped_at_the_size_that_it_claims() -> None:
    content = claim(packed([("a", bytes(50_000_000))]), SIZE, 100)
    tracemalloc.start()
    try:
        with pytest.raises(zipfile.BadZipFile, match="CRC"):
            unpack(content)
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


def test_the_table_of_contents_is_bounded() -> None:
    entry = bytes(packed([("a", b"")]))
    start = entry.index(b"PK\x01\x02")
    table = entry[start : start + 47] * (archive.MOST_MEMBERS + 1)
    end = struct.pack("<4s4H2IH", b"PK\x05\x06", 0, 0, 0, 0, len(table), start, 0)
    tracemalloc.start()
    try:
        with pytest.raises(zipfile.BadZipFile, match="more than 100000 members"):
            unpack(entry[:start] + table + end)
        assert tracemalloc.get_traced_memory()[1] < 10_000_000
    finally:
        tracemalloc.stop()
