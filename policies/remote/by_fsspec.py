"""Files that fsspec reaches: S3, GCS, SSH, Hugging Face, and many more."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import fsspec
from fsspec.callbacks import Callback

from nathlon.policies.policy_file import MOST_BYTES
from nathlon.policies.remote.remote import Listed

MARKS = (
    "lfs",
    "ETag",
    "etag",
    "md5Hash",
    "crc32c",
    "blob_id",
    "checksum",
    "mtime",
    "LastModified",
    "created",
)
"""Facts of a listing that change with a file, the best first."""


class FsspecRemote:
    """A folder or a file at a URL."""

    def __init__(self, address: str) -> None:
        self._files, self._root = fsspec.core.url_to_fs(address)

    def listing(self) -> Mapping[str, Listed]:
        """As of Remote."""
        # What an earlier look has found would hide what is new.
        self._files.invalidate_cache()
        found = self._files.find(self._root, detail=True)
        if not found and not self._files.exists(self._root):
            raise FileNotFoundError("there is nothing at this address")
        if list(found) == [self._root]:
            # A search that ends where it begins often tells nothing of what it has found.
            return {self._root.rpartition("/")[2]: _listed(self._files.info(self._root))}
        skipped = len(self._root.rstrip("/")) + 1
        return {path[skipped:]: _listed(facts) for path, facts in found.items()}

    def fetch(self, path: str, to: Path) -> None:
        """As of Remote."""
        alone = self._root.rpartition("/")[2] == path and self._files.isfile(self._root)
        whole = self._root if alone else f"{self._root.rstrip('/')}/{path}"
        self._files.get_file(whole, str(to), callback=_Bounded())


class _Bounded(Callback):  # type: ignore[misc]  # fsspec carries no types
    """Ends a transfer of more than a checkpoint may have: a listing need not say sizes, or the right ones."""

    def call(self, *_: object, **__: object) -> None:
        """See `Callback.call`."""
        if self.value > MOST_BYTES:
            raise ValueError(f"a file has more than {MOST_BYTES} bytes")


def _listed(facts: Mapping[str, object]) -> Listed:
    size = facts.get("size")
    mark = next((facts[name] for name in MARKS if facts.get(name) is not None), None)
    return Listed(None if mark is None else f"{mark} {size}", size if isinstance(size, int) else None)
