"""What selecting is worth: whom it sends against whom one would send without it, and how many races it takes.

`python -m benchmarks.selection_value --json FILE [--folder FOLDER] [--image FILE] [--pairs 60] [--workers 1]`
selects among the bundled checkpoints of every circuit as `nathlon evaluate` does.
The finalists, the last checkpoint (most transitions) and the fastest (best mean lap of the time trials) then
race each other in `pairs` mirrored pairs of every two, on seeds that the selection has not seen. The races
stay in the folder, which `benchmarks.calibration` shares.

By circuit:

- `sent`, `last`, `fastest`: names. Who had the best return in training is not known: the cards do not record
  it, and the runs of a ladder have different rewards;
- `over_last`, `over_fastest`: the one sent against the other, `benchmarks.selection_value.head_to_head`; null
  where they are one;
- `curve`, by races: how many points a race more than all finalists, on average, the one makes who would be
  sent after a round robin of so many, `benchmarks.selection_value.budget`; one who is drawn by lot makes 0;
- `enough`: the fewest races after which the most bring less than 0.1 points more;
- `leads`: the same points of `sent`, `last` and `fastest`, from all fresh races;
- `races`: of the selection's own round robin, which stops by itself.
"""

from __future__ import annotations

import argparse
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track

from benchmarks.ladder import Ladder, circuits, selected
from benchmarks.meetings import Meeting, Two, meetings
from benchmarks.result import write_result
from benchmarks.selection_value.budget import enough, expected_lead
from benchmarks.selection_value.head_to_head import head_to_head
from benchmarks.selection_value.plot import plot
from nathlon.arena.entrant import Entrant
from nathlon.tournament.evidence import appearances, differences

BUDGETS = (10, 20, 40, 80, 160, 320)
"""Races of a round robin."""
DRAWS = 2000
GAIN = 0.1
SEED = 2025


def measure(ladder: Ladder, pairs: int, console: Console) -> dict[str, Any]:
    """The figures of a ladder."""
    sent, last, fastest = ladder.sent, ladder.last, ladder.fastest
    finalists = ladder.finalists
    met = meetings(ladder.race(list(dict.fromkeys([*finalists, last, fastest])), pairs))
    rng = np.random.default_rng(SEED)
    raced = {
        (first, second): gaps(met, one, other)
        for (first, one), (second, other) in combinations(enumerate(finalists), 2)
    }
    curve = {
        races: round(expected_lead(raced, len(finalists), races, DRAWS, rng), 3)
        for races in track(BUDGETS, ladder.config.circuit, console=console)
    }
    return {
        "sent": sent.name,
        "last": last.name,
        "fastest": fastest.name,
        "over_last": against(met, sent, last, rng),
        "over_fastest": against(met, sent, fastest, rng),
        "curve": curve,
        "enough": enough(curve, GAIN),
        "leads": {
            name: round(lead(met, one, finalists), 3)
            for name, one in (("sent", sent), ("last", last), ("fastest", fastest))
        },
        "finalists": len(finalists),
        "races": ladder.tournament_races,
    }


def gaps(met: dict[Two, Meeting], one: Entrant, other: Entrant) -> np.ndarray:
    """Points a race of one less the other's, by mirrored pair."""
    difference = differences(appearances(met[frozenset((one.id, other.id))].results))["difference"].to_numpy()
    return difference if one.id < other.id else -difference


def lead(met: dict[Two, Meeting], one: Entrant, finalists: list[Entrant]) -> float:
    """By how many points a race one beats the finalists on average, itself as 0 among them."""
    return sum(gaps(met, one, other).mean() for other in finalists if other != one) / len(finalists)


def against(
    met: dict[Two, Meeting], one: Entrant, other: Entrant, rng: np.random.Generator
) -> dict[str, Any] | None:
    """One against another; None where they are the same."""
    if one == other:
        return None
    return head_to_head(met[frozenset((one.id, other.id))].results, one.id, rng)


def main() -> None:
    """Select on every circuit, race, and keep the figures and their picture."""
    parser = argparse.ArgumentParser(
        prog="benchmarks.selection_value", description="What selecting is worth, and how many races it takes"
    )
    parser.add_argument("--json", type=Path, required=True, help="where the figures go")
    parser.add_argument("--folder", type=Path, default=Path("build/calibration"), help="of the races")
    parser.add_argument("--image", type=Path, default=Path("docs/images/selection-value.png"), help="picture")
    parser.add_argument("--pairs", type=int, default=60, help="raced of every two")
    parser.add_argument("--workers", type=int, default=1, help="processes that race")
    chosen = parser.parse_args()
    console = Console(stderr=True)
    figures = {}
    for circuit in circuits():
        with selected(circuit, chosen.folder / circuit, chosen.workers) as ladder:
            figures[circuit] = measure(ladder, chosen.pairs, console)
    plot(figures, chosen.image)
    write_result(chosen.json, figures)


if __name__ == "__main__":
    main()
