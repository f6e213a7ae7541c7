"""Checkpoints of the bundled runs that only benchmarks need, beside those that come with nathlon."""

from __future__ import annotations

from pathlib import Path

from nathlon.policies.bundled import BUNDLED


def folders(circuit: str) -> list[Path]:
    """Where the checkpoints of a circuit lie; `generalist` has those for any."""
    return [place / circuit for place in (BUNDLED, Path(__file__).parent) if (place / circuit).is_dir()]


def ladder(circuit: str) -> list[Path]:
    """All checkpoints of a circuit, by name."""
    return sorted(
        (path for folder in folders(circuit) for path in folder.glob("*.safetensors")),
        key=lambda path: path.name,
    )
