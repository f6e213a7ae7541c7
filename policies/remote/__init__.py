"""Checkpoints that lie elsewhere, by their addresses: they are fetched into a folder of this machine."""

from __future__ import annotations

import re

REMOTE = re.compile(r"(wandb|mlflow|hf):.|(?!object:)[a-z][a-z0-9+.-]*://", re.IGNORECASE)


def is_remote(given: str) -> bool:
    """Whether what a user has given is an address: `wandb:`, `mlflow:`, `hf:`, or a URL that fsspec knows."""
    return REMOTE.match(given) is not None
