"""Whether the selection's statistics keep their word on races of the simulator.

`python -m benchmarks.calibration [--json FILE] [--folder build/calibration] [--tournaments 1000]
[--pairs 200] [--runs 64] [--workers 1]`. It ends with 1 and one sentence where the races show no spread: then
every interval would hold, and nothing would be tested.

The finalists of a bundled ladder race each other once, in `pairs` mirrored pairs of every two. All its
checkpoints drive `runs` time trials and races of the filter, and those that the filter kept as many runs of
every skill test. All that stays in the folder, where a run that was stopped goes on. From it selections are
drawn, with replacement, and judged by the code of the stages; all races together are the truth.

- `equal`, by number of entrants: tournaments of equals. Every mirrored pair is one of two finalists that
  differ by less than the least effect that matters, and its sides go to two names by lot;
- `finalists`, by number of entrants: tournaments of finalists, chosen by lot each time;
- `filter`: how much of the true Pareto front the filter keeps, `benchmarks.calibration.filters`;
- `battery`: `survivors`, the skill tests of those that the filter kept; `equal`, of six with runs of one and
  the same checkpoint, drawn apart for each.

`coverage`, `false_accept` and others are explained in `benchmarks.calibration.tally`. `pool_sd` is the
standard deviation from pair to pair, points a race, or from run to run, points of a test; `pairs_share` the
pairs that were raced, of their cap.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track

from benchmarks.calibration import batteries, filters, tournaments
from benchmarks.ladder import Ladder, selected
from benchmarks.meetings import meetings
from benchmarks.result import write_result
from nathlon.selection.battery.skill import load_skills

CIRCUIT = "lindenring"
SIZES = (2, 4, 6)
EQUALS = 6
"""In a battery."""
SEED = 2024
NO_SPREAD = 1e-6
"""Standard deviation, points, that is none."""


def of_tournaments(ladder: Ladder, pairs: int, count: int, console: Console) -> dict[str, Any]:
    """The entries `equal` and `finalists`."""
    settings, finalists = ladder.config.tournament, ladder.finalists
    met = meetings(ladder.race(finalists, pairs))
    need_spread("finalists", tournaments.pool_sd(met.values()))
    near = tournaments.nearly_equal(list(met.values()), settings.effect)
    if not near:
        raise SystemExit("no two finalists are nearly equal: there is nothing to draw equals from")
    figures: dict[str, Any] = {"equal": {}, "finalists": {}}
    for size in SIZES:
        for name, kind in (
            ("equal", tournaments.of_equals(ladder.sent, near, size)),
            ("finalists", tournaments.of_finalists(finalists, met, size)),
        ):
            numbers = track(range(count), f"{size}, {name}", console=console)
            figures[name][size] = tournaments.judged(ladder.run, kind, settings, numbers)
    return figures


def of_filter(ladder: Ladder, runs: int, count: int, console: Console) -> dict[str, Any]:
    """The entry `filter`."""
    raced = filters.RacedRuns(ladder.filter_runs(runs))
    numbers = track(range(count), "Filters", console=console)
    figures = filters.judged(ladder.run, ladder.entrants, raced, ladder.config.pareto, numbers)
    for name, sd in figures["pool_sd"].items():
        need_spread(f"filter.{name}", sd)
    return figures


def of_battery(ladder: Ladder, runs: int, count: int, console: Console) -> dict[str, Any]:
    """The entry `battery`."""
    marks, tests = ladder.marks(runs), load_skills(ladder.config.battery.tests)
    need_spread("battery", batteries.pool_sd(marks))
    numbers = range(count)
    return {
        "survivors": batteries.of_survivors(marks, tests, track(numbers, "Batteries", console=console), SEED),
        "equal": batteries.of_equals(
            marks, tests, EQUALS, track(numbers, "Batteries of equals", console=console), SEED
        ),
    }


def need_spread(what: str, sd: float) -> None:
    """End with one sentence where races do not differ: every interval would hold, and no rank be wrong."""
    if not sd > NO_SPREAD:
        raise SystemExit(
            f"{what}: pool_sd is {sd:g}, expected races that differ; there is nothing to calibrate"
        )


def main() -> None:
    """Race what is missing, draw, show progress on stderr, print the figures as JSON."""
    parser = argparse.ArgumentParser(prog="benchmarks.calibration", description="Whether the statistics hold")
    parser.add_argument("--json", type=Path, nargs="?", help="file for the figures as well")
    parser.add_argument("--folder", type=Path, default=Path("build/calibration"), help="of the races")
    parser.add_argument("--tournaments", type=int, default=1000, help="drawn of each kind")
    parser.add_argument("--pairs", type=int, default=200, help="raced of every two finalists")
    parser.add_argument("--runs", type=int, default=64, help="of the filter's tests and of every skill test")
    parser.add_argument("--workers", type=int, default=1, help="processes that race")
    chosen = parser.parse_args()
    console = Console(stderr=True)
    with selected(CIRCUIT, chosen.folder / CIRCUIT, chosen.workers) as ladder:
        figures: Mapping[str, Any] = {
            **of_tournaments(ladder, chosen.pairs, chosen.tournaments, console),
            "filter": of_filter(ladder, chosen.runs, chosen.tournaments, console),
            "battery": of_battery(ladder, chosen.runs, chosen.tournaments, console),
            "pairs": chosen.pairs,
            "runs": chosen.runs,
            "effect": ladder.config.tournament.effect,
        }
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
