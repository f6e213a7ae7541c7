"""`nathlon export`."""

from __future__ import annotations

from pathlib import Path

from nathlon.commands.console import say
from policies.checkpoint import load_checkpoint
from policies.onnx import export_onnx


def export(checkpoint: Path, onnx: Path) -> None:
    """Write the policy of a checkpoint as ONNX."""
    export_onnx(load_checkpoint(checkpoint), onnx)
    say(f"ONNX         {onnx}")
