"""What the Pareto filter keeps of planted fields, of which the true front is known.

Run as `python -m benchmarks.planted_fields [--json FILE]`; prints one JSON object: by the kind of
field and the runs of each entrant, means over fields of

- `front`: entrants that nobody dominates in truth;
- `seen`: share of them on the front of the means of their runs;
- `kept`: share of them that survive;
- `survivors`: entrants that survive;
- `runs`: of an entrant.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import moocore
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from benchmarks.result import write_result
from nathlon.arena.statistics import group_sums
from nathlon.selection.pareto import nondominated_probability, surviving
from nathlon.selection.pareto.filter import FilterSettings, undecided
from nathlon.selection.pareto.objective import Measured

SEED = 2028

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]


@dataclass(frozen=True)
class Truth:
    """What objectives of E entrants truly are, each (E, 1): laps in s, time off course in s, contacts."""

    lap_s: Floats
    off_course_s: Floats
    contacts: Floats

    @property
    def front(self) -> NDArray[np.bool_]:
        """Who is not dominated (E,)."""
        return moocore.is_nondominated(
            np.hstack([self.lap_s, self.off_course_s, self.contacts]), keep_weakly=True
        )


@dataclass(frozen=True)
class Kind:
    """Fields of one kind: how many, of how many entrants, their truth, and its runs as (3, E, R)."""

    fields: int
    entrants: int
    plant: Callable[[np.random.Generator, int], Truth]
    drive: Callable[[np.random.Generator, Truth, int], Floats]


def plant_thousands(rng: np.random.Generator, entrants: int) -> Truth:
    """A field of which one in a hundred is on the front."""
    shape = (entrants, 1)
    return Truth(
        100 + rng.gamma(2.0, 1.5, shape), rng.gamma(1.0, 6.0, shape) + 0.3, rng.gamma(1.0, 3.0, shape) + 0.1
    )


def plant_twenty(spread: float) -> Callable[[np.random.Generator, int], Truth]:
    """A field with time off course of a given standard deviation between entrants, relative to the mean."""

    def plant(rng: np.random.Generator, entrants: int) -> Truth:
        shape = (entrants, 1)
        return Truth(
            105.7 + rng.gamma(1.0, 1.5, shape),
            rng.gamma(spread**-2, 2.0 * spread**2, shape),
            rng.gamma(2.0, 1.5, shape),
        )

    return plant


def drive_noisily(rng: np.random.Generator, truth: Truth, runs: int) -> Floats:
    """Laps within half a second, time off course within a half, contacts as they come."""
    shape = (len(truth.lap_s), runs)
    off_course_s = rng.gamma(4.0, truth.off_course_s / 4, shape)
    return np.array([rng.normal(truth.lap_s, 0.5, shape), off_course_s, rng.poisson(truth.contacts, shape)])


def drive_quietly(rng: np.random.Generator, truth: Truth, runs: int) -> Floats:
    """Laps within 0.05 s, all else within a tenth."""
    tenths = rng.normal(1, 0.1, (2, len(truth.lap_s), runs))
    lap_s = rng.normal(truth.lap_s, 0.05, tenths.shape[1:])
    return np.array([lap_s, truth.off_course_s * tenths[0], truth.contacts * tenths[1]])


def drive_as_races_go(rng: np.random.Generator, truth: Truth, runs: int) -> Floats:
    """Laps within 0.1 s, time off course mostly none and now and then many seconds, busy races and quiet."""
    shape = (len(truth.lap_s), runs)
    contacts = rng.poisson(truth.contacts * rng.gamma(4.0, 0.25, shape))
    off_course_s = rng.gamma(0.5, 2.0 * truth.off_course_s, shape).round(1)
    return np.array([rng.normal(truth.lap_s, 0.1, shape), off_course_s, contacts])


KINDS = {
    "noisy": Kind(3, 3000, plant_thousands, drive_noisily),
    "quiet": Kind(3, 3000, plant_thousands, drive_quietly),
    "twenty, off course differs": Kind(30, 20, plant_twenty(0.7), drive_as_races_go),
    "twenty, off course hardly differs": Kind(30, 20, plant_twenty(0.15), drive_as_races_go),
}


def measured(runs: Floats, sizes: Counts) -> list[Measured]:
    """The objectives from the first runs of each entrant."""
    names = [f"entrant {index:04}" for index in range(len(sizes))]
    driven = np.arange(runs.shape[-1]) < sizes[:, None]
    return [Measured(names, group_sums(costs[driven], sizes) / sizes, costs[driven], sizes) for costs in runs]


def filter_in_rounds(runs: Floats, first: int, rng: np.random.Generator) -> tuple[Floats, Counts]:
    """Probabilities to be on the front (E,) after rounds as the filter has them, and the runs of each."""
    sizes = np.full(runs.shape[1], first)
    while True:
        probability = nondominated_probability(measured(runs, sizes), FilterSettings().resamples, rng)
        again = undecided(probability) & (sizes < runs.shape[-1])
        if not again.any():
            return probability, sizes
        sizes = np.where(again, 2 * sizes, sizes)


def filter_once(runs: Floats, sizes: Counts, rng: np.random.Generator) -> tuple[Floats, Counts]:
    """Probabilities to be on the front (E,) after a given number of runs of each."""
    return nondominated_probability(measured(runs, sizes), FilterSettings().resamples, rng), sizes


Filter = Callable[[Floats, np.random.Generator], tuple[Floats, Counts]]


def equal_runs(count: int) -> tuple[int, Filter]:
    """Everybody has as many runs."""
    return count, lambda runs, rng: filter_once(runs, np.full(runs.shape[1], count), rng)


def in_rounds(first: int, most: int) -> tuple[int, Filter]:
    """Rounds from the first to the most runs."""
    return most, lambda runs, rng: filter_in_rounds(runs, first, rng)


def one_run(runs: Floats, rng: np.random.Generator) -> tuple[Floats, Counts]:
    """One run of each, two of every tenth."""
    return filter_once(runs, 1 + (np.arange(runs.shape[1]) % 10 == 0), rng)


FILTERS: dict[str, tuple[int, Filter]] = {
    "1, a tenth 2": (2, one_run),
    "2": equal_runs(2),
    "4": equal_runs(4),
    "8": equal_runs(8),
    "16": equal_runs(16),
    "32": equal_runs(32),
    "2 to 8": in_rounds(2, 8),
    "2 to 16": in_rounds(2, 16),
}


def judge(kind: Kind, most: int, select: Filter) -> dict[str, float]:
    """What a filter makes of fields of one kind, in the mean."""
    outcomes = []
    for index in range(kind.fields):
        rng = np.random.default_rng((SEED, index))
        truth = kind.plant(rng, kind.entrants)
        runs = kind.drive(rng, truth, most)
        probability, sizes = select(runs, rng)
        survives = surviving(probability, FilterSettings().keep_probability)
        means = np.stack([objective.cost for objective in measured(runs, sizes)], axis=-1)
        seen = moocore.is_nondominated(means, keep_weakly=True)
        front = truth.front
        outcomes.append(
            (front.sum(), seen[front].mean(), survives[front].mean(), survives.sum(), sizes.mean())
        )
    means = np.mean(outcomes, axis=0).round(3).tolist()
    return dict(zip(("front", "seen", "kept", "survivors", "runs"), means, strict=True))


def main() -> None:
    """Print the figures, showing progress on stderr."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="file for the figures as well")
    chosen = parser.parse_args()
    pairs: Iterable[tuple[str, str]] = [(kind, runs) for kind in KINDS for runs in FILTERS]
    figures: dict[str, dict[str, dict[str, float]]] = {kind: {} for kind in KINDS}
    for kind, runs in track(list(pairs), "Fields", console=Console(stderr=True)):
        figures[kind][runs] = judge(KINDS[kind], *FILTERS[runs])
    if chosen.json:
        write_result(chosen.json, figures)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
