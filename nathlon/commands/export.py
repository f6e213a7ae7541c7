"""`nathlon export`."""

from __future__ import annotations

from pathlib import Path

from nathlon.commands.console import tell
from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.onnx import export_onnx
from nathlon.sim.errors import InputError


def export(checkpoint: Path, onnx: Path, as_json: bool) -> None:
    """Write the policy of a checkpoint as ONNX."""
    if not onnx.parent.is_dir():
        raise InputError(f"{onnx.parent}: no such folder, expected one for the ONNX file")
    export_onnx(load_checkpoint(checkpoint), onnx)
    tell({"onnx": onnx}, as_json)
