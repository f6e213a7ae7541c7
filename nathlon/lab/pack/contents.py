"""What a packed run holds."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from nathlon.policies.policy_file import MOST_BYTES
from nathlon.policies.sources import COMPOSITE, DRIVER, PLUGIN, RANDOM, ROLES
from nathlon.policies.sources.archive import unpack
from nathlon.policies.sources.composite import CompositeSource
from nathlon.results.part import ResultModel
from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import read_bytes
from nathlon.sim.validation import read_json

VERSION = 1
MANIFEST, SIGNATURE = "manifest.json", "manifest.json.sig"
MATCHES, ENTRANTS_FILE = "matches.json", "entrants.json"
CHECKPOINTS = "checkpoints"
SAFE = re.compile(r"[\w-][\w.-]*(/[\w-][\w.-]*)*")
"""Names of files in a pack."""
NO_FILES = (DRIVER, PLUGIN, RANDOM)
"""Kinds of entrants that a pack only names."""
MOST_MIB = MOST_BYTES >> 20
"""Of a pack, and of its files together."""


class Manifest(ResultModel):
    """What a pack is, and all that is in it beside its signature.

    Attributes:
        version: of this format.
        run: name of the run.
        code: fingerprint of what decides results, see `nathlon.sim.decisive`.
        versions: of Python and packages.
        files: SHA-256 by name.
    """

    version: int = VERSION
    run: str
    code: str
    versions: dict[str, str]
    files: dict[str, str]


class PackedMatch(ResultModel):
    """A match of the tournament: what decides it, what it came to, and the kind of processor that ran it."""

    key: str
    spec: dict[str, Any]
    results: dict[str, list[Any]]
    processor: str | None


def check_no_code(source: str) -> None:
    """Raise an InputError for a composite whose strategist is code: what is in a pack is data."""
    if source.endswith(COMPOSITE) and not source.endswith(ROLES):
        strategist = CompositeSource.read(Path(source)).file.strategist
        if strategist is not None:
            raise InputError(
                f"{source}: strategist is {strategist!r}, which is code, expected a plan or planner"
            )


def digest(content: bytes) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def read_pack(path: Path) -> tuple[Manifest, Mapping[str, bytes]]:
    """A pack's manifest and its files by name, whose digests are those of the manifest.

    Raises:
        InputError: if it is no pack, is damaged, or a file was changed, added or left out.
    """
    try:
        files = unpack(read_bytes(path, MOST_MIB, "pack"))
        manifest = read_json(files[MANIFEST], Manifest, f"{path}: {MANIFEST}")
    except (BadZipFile, KeyError):
        raise InputError(f"{path}: not a packed run, expected what nathlon pack writes") from None
    if manifest.version > VERSION:
        raise InputError(f"{path}: field version is {manifest.version}, expected at most {VERSION}")
    for name in sorted(files.keys() ^ {*manifest.files, MANIFEST, *({SIGNATURE} & files.keys())}):
        raise InputError(f"{path}: {name!a} is not in both file and manifest, expected the same files")
    for name, known in manifest.files.items():
        if not SAFE.fullmatch(name):
            raise InputError(f"{path}: {name!a} is no name of a file here")
        if digest(files[name]) != known:
            raise InputError(f"{path}: {name} was changed, expected the contents that the manifest names")
    return manifest, files
