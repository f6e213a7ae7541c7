"""How far the Pareto filter thins a field of twenty: `python -m benchmarks.small_field`.

Planted fields with laps that runs tell apart, contacts that are counted, and time off course that is mostly
none and now and then many seconds. Prints one JSON object: by the spread of the true time off course and the
runs of each entrant, means over the fields of `front` (entrants that nobody dominates in truth), `kept`
(share of them that survive) and `survivors`.
"""

from __future__ import annotations

import json

import moocore
import numpy as np
from numpy.typing import NDArray

from nathlon.filter import FilterSettings
from nathlon.objective import Measured
from nathlon.pareto import nondominated_probability

ENTRANTS, FIELDS, SEED = 20, 30, 2028
RUNS = (2, 8, 32)
SPREADS = (0.7, 0.15)
"""Standard deviations of the true time off course between entrants, relative to its mean."""

Floats = NDArray[np.float64]


def measured(runs: Floats) -> Measured:
    """An objective from the costs (E, R) of equally long runs."""
    entrants, count = runs.shape
    names = [f"entrant {index:02}" for index in range(entrants)]
    return Measured(names, runs.mean(axis=1), runs.ravel(), np.full(entrants, count))


def plant(rng: np.random.Generator, spread: float, runs: int) -> tuple[NDArray[np.bool_], list[Measured]]:
    """Who is on the true front of a field (E,), and what its runs measure."""
    lap_s = 105.7 + rng.gamma(1.0, 1.5, (ENTRANTS, 1))
    off_course_s = rng.gamma(spread**-2, 2.0 * spread**2, (ENTRANTS, 1))
    contacts = rng.gamma(2.0, 1.5, (ENTRANTS, 1))
    front = moocore.is_nondominated(np.hstack([lap_s, off_course_s, contacts]), keep_weakly=True)
    shape = (ENTRANTS, runs)
    seen = (
        rng.normal(lap_s, 0.1, shape),
        rng.gamma(0.5, 2.0 * off_course_s, shape).round(1),
        rng.poisson(contacts * rng.gamma(4.0, 0.25, shape)).astype(np.float64),
    )
    return front, [measured(objective) for objective in seen]


def thin(spread: float, runs: int) -> dict[str, float]:
    """What the filter makes of planted fields, in the mean."""
    settings = FilterSettings()
    outcomes = []
    for seed in range(FIELDS):
        rng = np.random.default_rng((SEED, seed))
        front, objectives = plant(rng, spread, runs)
        survives = nondominated_probability(objectives, settings.resamples, rng) >= settings.keep_probability
        outcomes.append((front.sum(), survives[front].mean(), survives.sum()))
    means = np.mean(outcomes, axis=0).round(3).tolist()
    return dict(zip(("front", "kept", "survivors"), means, strict=True))


def main() -> None:
    """Print the figures."""
    print(json.dumps({str(spread): {str(runs): thin(spread, runs) for runs in RUNS} for spread in SPREADS}))


if __name__ == "__main__":
    main()
