"""What a race's recording, replay, page and video cost: processor time and bytes, at 10 samples a second.

A made-up race of eight cars on a circuit of the package, driven by the built-in driver:

    python -m benchmarks.replay --json FILE
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.result import write_result
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recorder import record_races
from nathlon.arena.recording import read_recording, write_recording
from nathlon.reports.player import write_player
from nathlon.reports.replay import write_replay
from nathlon.reports.video import write_video

DRIVERS = ("driver:pace=0.95", "driver:pace=0.9")
CLIP_S = 5.0


def race_log(circuit: str, seed: int) -> tuple[RaceLog, float]:
    """A race of eight cars from the grid, and the processor time that it took to run it again and keep it."""
    seats = tuple(Seat(slot % 2, slot % 2) for slot in range(8))
    match = Match("race", "race", "race", circuit, "gt3", DRIVERS, DRIVERS, (Race(seed, seats),))
    policies = match_policies(match)
    began = time.process_time()
    [log] = record_races(match, policies, [0], DRIVERS).logs
    return log, time.process_time() - began


def measure(log: RaceLog, folder: Path) -> dict[str, dict[str, Any]]:
    """Processor time and bytes of every kind of file; of the video those of a clip of CLIP_S seconds."""
    kinds: dict[str, Callable[[Path], object]] = {
        "mcap": lambda path: write_recording(path, log),
        "rrd": lambda path: write_replay(log, path),
        "html": lambda path: write_player(log, path),
        "mp4": lambda path: write_video(log, path, None, 0.0, CLIP_S),
    }
    figures: dict[str, dict[str, Any]] = {}
    for kind, write in kinds.items():
        path = folder / f"race.{kind}"
        began = time.process_time()
        write(path)
        figures[kind] = {
            "write_cpu_s": round(time.process_time() - began, 2),
            "bytes": path.stat().st_size,
        }
    began = time.process_time()
    read_recording(folder / "race.mcap")
    figures["mcap"]["read_cpu_s"] = round(time.process_time() - began, 2)
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--circuit", default="lindenring")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    options = parser.parse_args()
    log, simulated_s = race_log(options.circuit, options.seed)
    with tempfile.TemporaryDirectory() as name:
        files = measure(log, Path(name))
    facts: dict[str, Any] = {
        "circuit": options.circuit,
        "cars": len(log.names),
        "race_s": round(float(log.time_s[-1]), 1),
        "samples": log.samples.size,
        "run_again_cpu_s": round(simulated_s, 2),
        "clip_s": CLIP_S,
        "files": files,
    }
    if options.json:
        write_result(options.json, facts)
    for name, value in facts.items():
        if name != "files":
            print(f"{name:<16} {value}")
    for kind, figures in files.items():
        print(f"{kind:<16} {', '.join(f'{name} {value:,}' for name, value in figures.items())}")


if __name__ == "__main__":
    main()
