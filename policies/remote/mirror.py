"""A folder of this machine that holds what lies at an address, each file fetched once."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from nathlon.policies.policy_file import MOST_BYTES, content_id
from nathlon.policies.remote.remote import Listed, Remote
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need
from nathlon.sim.names import file_stem, printable
from nathlon.sim.whole_file import whole_file, write_whole

INDEX = ".index.json"
"""What is there: marks and digests by path."""
USER = re.compile(r"//[^/@]+@")
LONGEST = 200
"""Letters of what a library says of a failure."""


def mirrored(address: str, wanted: Callable[[str], bool]) -> Path:
    """The folder with the files that lie at an address now; what has not changed is not fetched again.

    Args:
        address: `wandb:`, `mlflow:`, `hf:`, or a URL that fsspec knows.
        wanted: whether a file is to be fetched, by its name.

    Raises:
        InputError: if the place cannot be reached, or what it needs is not installed.
    """
    shown = printable(USER.sub("//***@", address))
    folder = _cache() / f"{file_stem(shown)}-{hashlib.sha256(address.encode()).hexdigest()[:8]}"
    try:
        remote = _remote(address)
        listing = {
            path: listed
            for path, listed in sorted(remote.listing().items())
            if _is_safe(path) and wanted(path.rpartition("/")[2])
        }
    except InputError:
        raise
    except Exception as error:  # of a library, which may raise anything
        raise _failed(shown, error) from None
    folder.mkdir(parents=True, exist_ok=True)
    index = _index(folder)
    for path in index.keys() - listing.keys():
        (folder / path).unlink(missing_ok=True)
        del index[path]
    try:
        for path, listed in listing.items():
            if not _is_held(folder, path, listed, index.get(path)):
                index[path] = _fetched(remote, folder, path, listed, shown)
    finally:
        write_whole(folder / INDEX, json.dumps(index, indent=1))
    return folder


def _is_safe(path: str) -> bool:
    """Whether a path of a listing leads into the folder, and is not hidden."""
    parts = path.split("/")
    return "\\" not in path and ":" not in path and not any(part[:1] in ("", ".") for part in parts)


def _is_held(folder: Path, path: str, listed: Listed, entry: list[str] | None) -> bool:
    """Whether a file is there as it was listed, whole and unchanged."""
    file = folder / path
    if entry is None or entry[0] != listed.mark or not file.is_file():
        return False
    return content_id(file.read_bytes()) == entry[1]


def _fetched(remote: Remote, folder: Path, path: str, listed: Listed, shown: str) -> list[str]:
    if listed.size is not None and listed.size > MOST_BYTES:
        raise InputError(f"{shown}: {printable(path)} has {listed.size} bytes, expected at most {MOST_BYTES}")
    file = folder / path
    file.parent.mkdir(parents=True, exist_ok=True)
    try:
        with whole_file(file) as partial:
            remote.fetch(path, partial)
    except Exception as error:
        raise _failed(shown, error) from None
    return [listed.mark, content_id(file.read_bytes())]


def _remote(address: str) -> Remote:
    kind, _, name = address.partition(":")
    if kind == "wandb":
        need("wandb", "wandb", f"{kind}:")
        from nathlon.policies.remote.by_wandb import WandbRemote

        return WandbRemote(name)
    if kind == "mlflow":
        need("mlflow", "mlflow", f"{kind}:")
        from nathlon.policies.remote.by_mlflow import MlflowRemote

        return MlflowRemote(name)
    if kind == "hf":
        need("huggingface_hub", "hf", f"{kind}:")
        address = f"hf://{name.removeprefix('//')}"
    need("fsspec", "remote", f"{kind}:")
    from nathlon.policies.remote.by_fsspec import FsspecRemote

    return FsspecRemote(address)


def _cache() -> Path:
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "nathlon" / "remote"


def _index(folder: Path) -> dict[str, list[str]]:
    try:
        found: Any = json.loads((folder / INDEX).read_text("utf-8"))
        return {path: [str(mark), str(digest)] for path, (mark, digest) in found.items()}
    except (OSError, ValueError, AttributeError, TypeError):
        return {}


def _failed(shown: str, error: Exception) -> InputError:
    said = printable(USER.sub("//***@", " ".join(str(error).split())))[:LONGEST] or type(error).__name__
    return InputError(f"{shown}: cannot be fetched: {said}")
