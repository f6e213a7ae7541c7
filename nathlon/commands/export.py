"""`nathlon export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nathlon.commands.options import AsJson
from nathlon.policies.sources import check_source
from nathlon.sim.whole_file import check_output
from nathlon.terminal import tell


def export(
    checkpoint: Annotated[Path, typer.Argument(help="Checkpoint (.safetensors).")],
    onnx: Annotated[Path, typer.Option("--onnx", help="The ONNX file to write.")],
    as_json: AsJson = False,
) -> None:
    """Write a checkpoint as an ONNX graph, which other programs can run and nathlon can race."""
    check_source(str(checkpoint))
    check_output(onnx, is_file=True)
    from nathlon.policies.checkpoint import load_checkpoint
    from nathlon.policies.sources.onnx import export_onnx

    export_onnx(load_checkpoint(checkpoint), onnx)
    tell({"onnx": onnx}, as_json)
