"""What a run's summary says of the programs that made it."""

from __future__ import annotations

import platform
from importlib.metadata import version

PACKAGES = ("nathlon", "numpy", "numba", "torch")


def versions() -> dict[str, str]:
    """Versions by name."""
    return {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}}
