"""How long one waits for the help, and to be told of a wrong path, name or option.

`python -m benchmarks.commands --json FILE` calls the command line of this checkout, each command `REPEATS`
times in turn.

Figures: medians of seconds from start to end, `wall_s` and `processor_s`, by command.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path

from benchmarks.result import write_result

REPEATS = 9
COMMANDS = {
    "--help": ("--help",),
    "wrong path": ("evaluate", "nowhere.safetensors"),
    "wrong circuit": ("race", "driver", "--circuit", "nowhere"),
    "wrong option": ("evaluate", "--fast"),
}


def main() -> None:
    """Call all commands, and keep the medians."""
    parser = argparse.ArgumentParser(prog="benchmarks.commands", description="How long commands take")
    parser.add_argument("--json", type=Path, required=True, help="where the figures go")
    chosen = parser.parse_args()
    wall: defaultdict[str, list[float]] = defaultdict(list)
    processor: defaultdict[str, list[float]] = defaultdict(list)
    for _ in range(REPEATS):
        for name, arguments in COMMANDS.items():
            took = _call(arguments)
            wall[name].append(took[0])
            processor[name].append(took[1])
    write_result(
        chosen.json,
        {
            name: {
                "wall_s": round(statistics.median(wall[name]), 2),
                "processor_s": round(statistics.median(processor[name]), 2),
            }
            for name in COMMANDS
        },
    )


def _call(arguments: tuple[str, ...]) -> tuple[float, float]:
    """Seconds that a command takes, and that it keeps processors busy."""
    nathlon = str(Path(sys.executable).with_name("nathlon"))
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([nathlon, *arguments], capture_output=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    busy = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - began, busy


if __name__ == "__main__":
    main()
