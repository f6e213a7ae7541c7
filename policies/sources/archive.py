"""Zip archives from others: unpacked in memory, every size bounded before it is believed."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from collections.abc import Collection

from nathlon.policies.policy_file import MOST_BYTES

MOST_MEMBERS = 100_000

_ENTRY, _ENTRY_BYTES = b"PK\x01\x02", 46
"""What begins each entry in the table of contents, and the least that it takes. `zipfile` keeps them all."""

_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ERRORS = (
    OSError,
    EOFError,
    ValueError,
    OverflowError,
    NotImplementedError,
    RuntimeError,
    struct.error,
    zlib.error,
)


def unpack(content: bytes, names: Collection[str] | None = None) -> dict[str, bytes]:
    """Members of an archive by name: all, or those of some names that there are.

    Raises:
        zipfile.BadZipFile: if it is damaged, encrypted or packed in an unusual way, has a name twice or more
            than `MOST_MEMBERS`, or if the members would have more than `MOST_BYTES` together.
    """
    if len(content) > MOST_MEMBERS * _ENTRY_BYTES and content.count(_ENTRY) > MOST_MEMBERS:
        raise zipfile.BadZipFile(f"more than {MOST_MEMBERS} members")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return _members(archive, names)
    except _ERRORS as error:
        raise zipfile.BadZipFile(str(error)) from None


def _members(archive: zipfile.ZipFile, names: Collection[str] | None) -> dict[str, bytes]:
    entries = archive.infolist()
    if len(set(archive.namelist())) != len(entries):
        raise zipfile.BadZipFile("a name stands for two members")
    chosen = [entry for entry in entries if names is None or entry.filename in names]
    if sum(entry.file_size for entry in chosen) > MOST_BYTES:
        raise zipfile.BadZipFile(f"unpacks to more than {MOST_BYTES} bytes")
    return {entry.filename: _member(archive, entry) for entry in chosen}


def _member(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> bytes:
    if entry.compress_type not in _METHODS:
        raise zipfile.BadZipFile(f"member {entry.filename!r} is packed in an unusual way")
    # Asked for a number, the reader unpacks no more than that, whatever is left over.
    with archive.open(entry) as member:
        content = member.read(entry.file_size + 1)
    if len(content) != entry.file_size:
        raise zipfile.BadZipFile(f"member {entry.filename!r} is cut off")
    return content
