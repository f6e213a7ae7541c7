"""Arguments and options that several commands take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nathlon.selection.bounds import LARGEST_SEED, MOST_PAIRS, MOST_SHORTLISTED, MOST_WORKERS

Checkpoints = Annotated[
    list[str],
    typer.Argument(
        help="Checkpoints (.safetensors, Stable-Baselines3 .zip, .onnx), folders, addresses, plugin:NAME."
    ),
]
WorldName = Annotated[
    str | None,
    typer.Option(
        "--world",
        help="Simulator, if it is not nathlon's own: MODULE:NAME, PATH.py:NAME, or a package's.",
    ),
]
StoreName = Annotated[str, typer.Argument(help="The store: path of its file, or URL of a database.")]
Recording = Annotated[Path, typer.Argument(help="Recording of a race (.mcap).")]
Circuit = Annotated[str, typer.Option(help="Name or path of the circuit.")]
CarName = Annotated[str, typer.Option("--car", help="Name or path of the car.")]
Port = Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on; 0 for any.")]
CircuitParent = Annotated[Path, typer.Option("--out", help="Folder that the circuit's folder goes into.")]
Out = Annotated[Path, typer.Option("--out", help="Folder for everything that the run leaves.")]
Seed = Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of all randomness.")]
ConfigSeed = Annotated[
    int | None,
    typer.Option(min=0, max=LARGEST_SEED, help="Seed of all randomness, instead of the configuration's."),
]
ConfigPath = Annotated[Path | None, typer.Option("--config", help="Configuration (nathlon init writes one).")]
ConfigFile = Annotated[Path, typer.Option("--config", help="Configuration (nathlon init writes one).")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Workers = Annotated[
    int | None, typer.Option(min=1, max=MOST_WORKERS, help="Processes; one for each core by default.")
]
EngineAddress = Annotated[
    str, typer.Option(help="Address of the Ray cluster; auto for the one of this machine.")
]
Shortlist = Annotated[
    int | None, typer.Option(min=1, max=MOST_SHORTLISTED, help="Entrants that reach the round robin.")
]
Pairs = Annotated[
    int | None,
    typer.Option(
        min=2,
        max=MOST_PAIRS,
        help="Mirrored pairs of races for every two of them, at most; an interval needs two.",
    ),
]
