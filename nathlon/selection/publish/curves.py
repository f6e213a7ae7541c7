"""The training curves of a run's entrants, kept in its store as they were at the time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import polars as pl

from nathlon.arena.results import CURVES
from nathlon.arena.store import Store
from nathlon.policies.sources import DRIVER, OBJECT, PLUGIN
from nathlon.sim.names import as_named, written

CURVE_FILE = "curve.csv"
CRITICS = ("mean_q", "entropy")
"""What a run of QR-SAC has, and polishing has not."""
NUMBERS = {name: dtype for name, dtype in CURVES.items() if name != "checkpoints"}


def keep_curves(store: Store, run: str) -> None:
    """Put the table `curves` of a run into its store, unless it is there already."""
    if store.table(run, "curves").is_empty():
        store.put_table(run, "curves", find_curves(store.table(run, "entrants")["source"]))


def find_curves(sources: Iterable[str]) -> pl.DataFrame:
    """CURVES of all training runs that left some checkpoints; a curve that cannot be read is passed over.

    Args:
        sources: paths of the checkpoints; drivers and plug-ins have no curve. A run's curve is `curve.csv`
            in the checkpoint's folder or in the one above, or `curves/RUN.csv` beside the folder of a
            checkpoint RUN-STEP.
    """
    files = [
        Path(as_named(source))
        for source in sources
        if source.partition(":")[0] not in (DRIVER, PLUGIN, OBJECT)
    ]
    curves = dict(place for file in files for place in _places(file))
    read = [(start, _read(path)) for start, path in sorted(curves.items())]
    frames = [
        frame.with_columns(checkpoints=pl.lit(written(start))) for start, frame in read if frame is not None
    ]
    return pl.concat([pl.DataFrame(schema=CURVES), *(frame.select(CURVES.names()) for frame in frames)])


def _places(checkpoint: Path) -> Iterator[tuple[str, Path]]:
    """What the paths of a run's checkpoints begin with, and where its curve would be."""
    folder, above = checkpoint.parent, checkpoint.parent.parent
    run = checkpoint.stem.rpartition("-")[0]
    yield _beginning(folder, ""), folder / CURVE_FILE
    yield _beginning(above, ""), above / CURVE_FILE
    yield _beginning(folder, f"{run}-"), above / "curves" / f"{run}.csv"


def _beginning(folder: Path, name: str) -> str:
    """What the paths of files in a folder begin with, whose names begin alike."""
    return str(folder / f"{name}*").removesuffix("*")


def _read(path: Path) -> pl.DataFrame | None:
    try:
        if not path.is_file():
            return None
        curve = pl.read_csv(path, schema_overrides=NUMBERS).fill_nan(None)
        missing = [pl.lit(None, NUMBERS[name]).alias(name) for name in CRITICS if name not in curve.columns]
        return curve.with_columns(missing).select(list(NUMBERS))
    except (OSError, pl.exceptions.PolarsError):
        return None
