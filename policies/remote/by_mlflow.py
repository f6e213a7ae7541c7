"""Versions in the registry of MLflow, and artefacts of its runs."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from mlflow import MlflowClient

from nathlon.policies.remote.remote import Listed


class MlflowRemote:
    """`MODEL@ALIAS`, `MODEL/VERSION`, or `runs/RUN` with a path of its artefacts behind it."""

    def __init__(self, name: str) -> None:
        self._client = MlflowClient()
        if name.startswith("runs/"):
            self._run, _, self._root = name.removeprefix("runs/").partition("/")
        else:
            model, by_alias, alias = name.partition("@")
            if by_alias:
                found = self._client.get_model_version_by_alias(model, alias)
            else:
                found = self._client.get_model_version(*name.rpartition("/")[::2])
            self._run = str(found.run_id)
            self._root = str(found.source).rstrip("/").rpartition("/artifacts/")[2]

    def listing(self) -> Mapping[str, Listed]:
        """As of Remote; a run that goes on may log a path again, and marks nothing."""
        ended = self._client.get_run(self._run).info.end_time
        waiting, found = [self._root], dict[str, Listed]()
        while waiting:
            for item in self._client.list_artifacts(self._run, waiting.pop() or None):
                if item.is_dir:
                    waiting.append(item.path)
                else:
                    path = item.path.removeprefix(f"{self._root}/")
                    mark = f"{self._run} {ended} {item.file_size}" if ended else None
                    found[path] = Listed(mark, item.file_size)
        return found

    def fetch(self, path: str, to: Path) -> None:
        """As of Remote."""
        with TemporaryDirectory(dir=to.parent, prefix=".") as folder:
            whole = f"{self._root}/{path}" if self._root else path
            shutil.move(self._client.download_artifacts(self._run, whole, folder), to)
