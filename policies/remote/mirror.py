"""A folder of this machine that holds what lies at an address, each file fetched once."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from nathlon.policies.policy_file import MOST_BYTES, content_id
from nathlon.policies.remote.remote import Listed, Remote
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need
from nathlon.sim.names import file_stem
from nathlon.sim.secrets import concealed, secrets_of, shown
from nathlon.sim.whole_file import whole_file, write_whole

INDEX = ".index.json"
"""What is there: marks and digests by path."""


def mirrored(address: str, wanted: Callable[[str], bool]) -> Path:
    """The folder with the files that lie at an address now; what has not changed is not fetched again.

    Args:
        address: `wandb:`, `mlflow:`, `hf:`, or a URL that fsspec knows.
        wanted: whether a file is to be fetched, by its name.

    Raises:
        InputError: if the place cannot be reached, or what it needs is not installed.
    """
    folder = _cache() / f"{file_stem(shown(address))}-{hashlib.sha256(address.encode()).hexdigest()[:8]}"
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
        raise _failed(address, error) from None
    folder.mkdir(parents=True, exist_ok=True)
    index = _index(folder)
    for path in index.keys() - listing.keys():
        (folder / path).unlink(missing_ok=True)
        del index[path]
    try:
        for path, listed in listing.items():
            if not _is_held(folder, path, listed, index.get(path)):
                index[path] = _fetched(remote, folder, path, listed, address)
    finally:
        write_whole(folder / INDEX, json.dumps(index, indent=1))
    return folder


def _is_safe(path: str) -> bool:
    """Whether a path of a listing leads into the folder, and is not hidden."""
    if "\\" in path or ":" in path or not path.isprintable():
        return False
    return not any(part[:1] in ("", ".") for part in path.split("/"))


def _is_held(folder: Path, path: str, listed: Listed, entry: list[str] | None) -> bool:
    """Whether a file is there as it was listed, whole and unchanged."""
    file = folder / path
    if entry is None or listed.mark is None or entry[0] != listed.mark or not file.is_file():
        return False
    return content_id(file.read_bytes()) == entry[1]


def _fetched(remote: Remote, folder: Path, path: str, listed: Listed, address: str) -> list[str]:
    file = folder / path
    try:
        _check_size(path, listed.size or 0)
        file.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(file) as partial:
            remote.fetch(path, partial)
            _check_size(path, partial.stat().st_size)
    except Exception as error:
        raise _failed(address, error) from None
    return [listed.mark or "", content_id(file.read_bytes())]


def _check_size(path: str, size: int) -> None:
    if size > MOST_BYTES:
        raise InputError(f"{path} has {size} bytes, expected at most {MOST_BYTES}")


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


def _failed(address: str, error: Exception) -> InputError:
    said = concealed(str(error), *secrets_of(address)) or type(error).__name__
    return InputError(f"{shown(address)}: cannot be fetched: {said}")
