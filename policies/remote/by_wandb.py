"""Artefacts of Weights & Biases."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import wandb

from nathlon.policies.remote.remote import Listed


class WandbRemote:
    """`ENTITY/PROJECT/ARTEFACT:ALIAS`."""

    def __init__(self, name: str) -> None:
        self._artefact = wandb.Api().artifact(name)

    def listing(self) -> Mapping[str, Listed]:
        """As of Remote."""
        entries = self._artefact.manifest.entries
        return {path: Listed(str(entry.digest), entry.size) for path, entry in entries.items()}

    def fetch(self, path: str, to: Path) -> None:
        """As of Remote."""
        with TemporaryDirectory(dir=to.parent, prefix=".") as folder:
            shutil.move(str(self._artefact.get_entry(path).download(root=folder)), to)
