"""Packed runs that somebody has changed."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any


def repacked(pack: Path, out: Path, change: Callable[[dict[str, Any]], None], honest: bool = True) -> Path:
    """A pack with changed files; the manifest of an honest one knows them, and nobody has signed it."""
    with zipfile.ZipFile(pack) as archive:
        files: dict[str, Any] = {name: archive.read(name) for name in archive.namelist()}
    change(files)
    if honest:
        files.pop("manifest.json.sig", None)
        manifest = json.loads(files["manifest.json"])
        known = {name: hashlib.sha256(files[name]).hexdigest() for name in files if name != "manifest.json"}
        files["manifest.json"] = json.dumps(manifest | {"files": known}).encode()
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return out
