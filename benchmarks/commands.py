"""How long one waits for the help, to be told of a wrong path, name or option, and for the first of anything.

`python -m benchmarks.commands --json FILE` calls the command line of this checkout, each command `REPEATS`
times in turn. With `--beside PYTHON` of another checkout it calls that one's right after each of its own, as
both then meet a machine that is equally busy.

- `first race`: two drivers for 25 s of the Lindenring in a new process.
- `worker start`: from asking a new pool for a process, whose fork server is up, until all kernels are loaded
  there; processor time of that process.
- `train, first update`: a run of one update, which is not compiled, from the start of the command to its end.

All others are from start to end of a command. Processor time is that of all processes that a command starts.
The cache of kernels is warm.

Figures: by command the medians of seconds `wall_s` and `processor_s`; beside another checkout also its own,
`beside`, and `ratio`, the median of this one's to its, by pair.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import resource
import statistics
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from benchmarks.result import write_result

REPEATS = 5
COMMANDS = {
    "--help": ("--help",),
    "wrong path": ("evaluate", "nowhere.safetensors"),
    "wrong circuit": ("race", "driver", "--circuit", "nowhere"),
    "wrong option": ("evaluate", "--fast"),
    "first race": ("race", "driver", "driver:pace=0.95", "--scenario", "braking_duel"),
}
TRAINING = """
circuit = "lindenring"
car = "gt3"
updates = 1
updates_per_step = 2
warm_up = 60
replay = 500
checkpoint_every = 1000

[[rollouts]]
scenario = "1v0"
races = 3
learners = 1

[observation]
course_points = 3
cars_ahead = 1
cars_behind = 1

[qrsac]
hidden = [8]
quantiles = 4
batch = 16
n_step = 5
"""
WORKER = """
import time
from itertools import chain
from nathlon.arena.job import Opening
from nathlon.arena.kernels import GROUPS
from nathlon.arena.pool import Pool

kernels = [Opening(load.__name__, load, ("lindenring", "gt3")) for load in chain(*GROUPS)]
clock = Opening("clock", time.process_time, ())
with Pool(1) as pool:
    pool.open([clock])
began = time.perf_counter()
with Pool(1) as pool:
    *_, busy = pool.open([*kernels, clock])
print(time.perf_counter() - began, busy)
"""
SUBREAPER = 36
"""Of Linux's `prctl`: processes whose parents have ended become children of this one, which can ask for their
times."""


class Took(NamedTuple):
    """Seconds from start to end, and those that processors were busy."""

    wall_s: float
    processor_s: float


Start = Callable[[Path, Path], Took]
"""Takes the time of something by the Python of a checkout, in an empty folder."""


def main() -> None:
    """Take all times, and keep the medians."""
    parser = argparse.ArgumentParser(prog="benchmarks.commands", description="How long commands take")
    parser.add_argument("--json", type=Path, required=True, help="where the figures go")
    parser.add_argument("--beside", type=Path, help="Python of another checkout")
    chosen = parser.parse_args()
    ctypes.CDLL(None).prctl(SUBREAPER, 1, 0, 0, 0)
    checkouts = [Path(sys.executable), *filter(None, [chosen.beside])]
    took: defaultdict[str, list[list[Took]]] = defaultdict(list)
    for repeat in range(-1, REPEATS):
        for name, start in STARTS.items():
            pair = [_in_empty_folder(start, python.absolute()) for python in checkouts]
            if repeat >= 0:  # the first one warms the caches
                took[name].append(pair)
    write_result(chosen.json, {name: _summary(pairs) for name, pairs in took.items()})


def _summary(pairs: list[list[Took]]) -> dict[str, object]:
    """Medians of one checkout, or of two and of the first's ratio to the second."""
    here, *beside = (_medians(list(times)) for times in zip(*pairs, strict=True))
    if not beside:
        return dict(here)
    ratios = [Took(*(one / other for one, other in zip(*pair, strict=True))) for pair in pairs]
    return {**here, "beside": beside[0], "ratio": _medians(ratios)}


def _medians(times: list[Took]) -> dict[str, float]:
    columns = zip(Took._fields, zip(*times, strict=True), strict=True)
    return {name: round(statistics.median(column), 3) for name, column in columns}


def _in_empty_folder(start: Start, python: Path) -> Took:
    with TemporaryDirectory() as folder:
        return start(python, Path(folder))


def _command(*arguments: str) -> Start:
    return lambda python, folder: _call([str(python.with_name("nathlon")), *arguments], folder)


def _import(python: Path, folder: Path) -> Took:
    return _call([str(python), "-c", "import nathlon"], folder)


def _train(python: Path, folder: Path) -> Took:
    config = folder / "training.toml"
    config.write_text(TRAINING, "utf-8")
    return _call([str(python.with_name("nathlon")), "train", str(config), "--out", "run", "--json"], folder)


def _worker(python: Path, folder: Path) -> Took:
    done = subprocess.run([python, "-c", WORKER], capture_output=True, text=True, check=True, cwd=folder)
    _leave_nobody()
    return Took(*map(float, done.stdout.split()))


def _call(command: list[str], folder: Path) -> Took:
    """How long a command takes, with all the processes that it has left behind."""
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, capture_output=True, check=False, cwd=folder)
    ended = time.perf_counter()
    _leave_nobody()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return Took(ended - began, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def _leave_nobody() -> None:
    """Wait for all that have become children of this process."""
    try:
        while True:
            os.wait()
    except ChildProcessError:
        return


STARTS: dict[str, Start] = {
    **{name: _command(*arguments) for name, arguments in COMMANDS.items()},
    "import nathlon": _import,
    "worker start": _worker,
    "train, first update": _train,
}


if __name__ == "__main__":
    main()
