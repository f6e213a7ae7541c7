"""Files that describe circuits, imported and driven: how many of each dialect cars can lap.

`python -m benchmarks.circuits_imported FOLDER` imports every file below a folder, lets the built-in driver
lap each circuit alone, and counts by dialect. Models of 1:10 lie in a folder with `scale-10` in its name.
What the driver has practised is kept, so a run that was stopped goes on.
"""

from __future__ import annotations

import argparse
import re
import signal
import tempfile
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from math import isfinite
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from benchmarks.result import write_result
from benchmarks.time_trial import drive_alone
from nathlon.arena.entrant import enter
from nathlon.sim.errors import InputError
from nathlon.sim.track import load_track
from nathlon.sim.track.collection import circuit_files, name_of
from nathlon.sim.track.importing import import_circuit
from nathlon.sim.track.map import draw_sheet

CAR = "gt3"
ALONE = str(Path(__file__).with_name("alone.toml"))
"""Two laps from a standing start: maps do not know the start line, which may lie in a bend."""
SCALED = re.compile(r"scale-(\d+)")


class Driven(NamedTuple):
    """What became of a file, and whether two laps were completed without ever leaving the course."""

    name: str
    dialect: str
    circuit: str = ""
    length_m: float = 0.0
    clean: bool = False
    lap_s: float = 0.0
    said: str = ""


def import_file(file: Path, folder: Path) -> Driven:
    """Import a file; its dialect is the folder that it lies in."""
    dialect = file.parent.name
    name, scaled = name_of(Path(f"{dialect}-{file.stem}")), SCALED.search(dialect)
    try:
        made = import_circuit(file, name, folder, scale=float(scaled[1]) if scaled else 1.0)
    except InputError as error:
        return Driven(file.stem, dialect, said=str(error).replace(f"{file}: ", ""))
    return Driven(file.stem, dialect, str(made.path), load_track(str(made.path)).length)


def drive(one: Driven, limit_s: int) -> Driven:
    """Laps by the built-in driver, given up after some time."""

    def give_up(_: int, __: FrameType | None) -> None:
        raise TimeoutError(f"not driven within {limit_s} s")

    signal.signal(signal.SIGALRM, give_up)
    signal.alarm(limit_s)
    try:
        trial = drive_alone(enter("driver", one.circuit, CAR), ALONE, starts=1)
    except (InputError, TimeoutError) as error:
        return one._replace(said=str(error))
    finally:
        signal.alarm(0)
    return one._replace(clean=trial.clean == 1, lap_s=round(trial.lap_s, 1) if isfinite(trial.lap_s) else 0.0)


def table(files: Sequence[Driven]) -> dict[str, dict[str, int]]:
    """How many files of each dialect were tried, imported, and lapped without leaving the course."""
    tried = Counter(one.dialect for one in files)
    imported = Counter(one.dialect for one in files if one.circuit)
    driven = Counter(one.dialect for one in files if one.clean)
    return {
        dialect: {"tried": count, "imported": imported[dialect], "driven": driven[dialect]}
        for dialect, count in sorted(tried.items())
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "folder", type=Path, help="a folder for each dialect, with files that describe circuits"
    )
    parser.add_argument("--workers", type=int, default=1, help="circuits driven at once")
    parser.add_argument(
        "--limit", type=int, default=600, metavar="SECONDS", help="for the laps on one circuit"
    )
    parser.add_argument("--sheet", type=Path, metavar="FILE", help="picture of the circuits")
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        files = [import_file(file, Path(name)) for file in circuit_files(options.folder)]
        imported = [one for one in files if one.circuit]
        if options.sheet:
            draw_sheet([load_track(one.circuit) for one in imported], options.sheet)
        with ProcessPoolExecutor(options.workers) as pool:
            done = []
            for one in pool.map(drive, imported, [options.limit] * len(imported)):
                print(
                    one.dialect,
                    one.name,
                    "clean" if one.clean else "not clean",
                    one.lap_s,
                    one.said,
                    flush=True,
                )
                done.append(one)
    files = [*done, *(one for one in files if not one.circuit)]
    figures: dict[str, Any] = {
        "car": CAR,
        "dialects": table(files),
        "files": [
            {
                "file": one.name,
                "dialect": one.dialect,
                "length_m": round(one.length_m),
                "clean": one.clean,
                "lap_s": one.lap_s,
                "said": one.said,
            }
            for one in sorted(files, key=lambda one: (one.dialect, one.name))
        ],
    }
    print(figures["dialects"])
    if options.json:
        write_result(options.json, figures)


if __name__ == "__main__":
    main()
