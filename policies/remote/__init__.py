"""Checkpoints that lie elsewhere, by their addresses: they are fetched into a folder of this machine."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from nathlon.policies.sources import COMPOSITE, SUFFIXES, TRAINING_STATE

REMOTE = re.compile(r"(wandb|mlflow|hf):.|(?!object:)[a-z][a-z0-9+.-]*://", re.IGNORECASE)
BESIDE = (COMPOSITE, ".pkl", ".yml", ".onnx.data")
"""What files end with that belong to policies, or name them."""


def is_remote(given: str | Path) -> bool:
    """Whether what a user has given is an address: `wandb:`, `mlflow:`, `hf:`, or a URL that fsspec knows."""
    return REMOTE.match(str(given)) is not None


def on_this_machine(given: Iterable[str]) -> list[str]:
    """What of it is no address."""
    return [one for one in given if not is_remote(one)]


def local(given: str | Path, endings: Iterable[str] = ()) -> str | Path:
    """The folder of this machine with the checkpoints that lie at an address; what is none as it is.

    Args:
        given: by a user.
        endings: of files that are checkpoints besides those that nathlon reads itself.

    Raises:
        InputError: if they cannot be fetched.
    """
    if not is_remote(given):
        return given
    from nathlon.policies.remote.mirror import mirrored

    known = (*SUFFIXES, *BESIDE, *endings)
    return mirrored(
        str(given), lambda name: name.lower().endswith(known) and name.lower() not in TRAINING_STATE
    )
