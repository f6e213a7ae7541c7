"""Filters, batteries and round robins of entrants whose truth is known."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import combinations
from typing import NamedTuple

import moocore
import numpy as np
import polars as pl
from numpy.typing import NDArray

from benchmarks.error_rates.noise import NOISES, Noise
from benchmarks.error_rates.simulation import Case, Outcome
from nathlon.arena.results import RESULTS
from nathlon.arena.statistics import Floats, group_sums, possible_ranks
from nathlon.selection.battery.ranking import MARKS, rank_battery
from nathlon.selection.pareto import nondominated_probability, surviving
from nathlon.selection.pareto.filter import FilterSettings, undecided
from nathlon.selection.pareto.objective import Measured
from nathlon.selection.round_robin import TournamentSettings
from nathlon.selection.run import CONFIDENCE
from nathlon.tournament.evidence import Evidence
from nathlon.tournament.points import EQUAL, better
from nathlon.tournament.stopping import Stopping, repeated, settled

FILTER, TOURNAMENT = FilterSettings(), TournamentSettings()
FIELD, OBJECTIVES = 12, 3
RUN_DEVIATION = 0.5
"""From run to run, in that from entrant to entrant."""
SIX, TESTS, TEST_RUNS = 6, 4, 8
POINTS, POINT_DEVIATION, FASTER = 500.0, 100.0, 150.0
"""Points of a test, from run to run, and by which the better one is better in each."""
THREE, PAIR_DEVIATION, STRONGER, SWEPT = 3, 6.0, 9.0, 16.0
"""Entrants; points of a pair, by which the better one is better, and lost in a disaster."""
EQUALS, RANGES = "equals have ranks", "ranges miss true ranks"


class Ranks(NamedTuple):
    """The best and the worst rank (K,) that each of K entrants may have, as a verdict says."""

    best: NDArray[np.int64]
    worst: NDArray[np.int64]


def ranges(said: Ranks) -> Outcome:
    """Any range without a rank that is true where the first entrant is better than the others, all equal.

    Found is the first, alone in the first rank.
    """
    first, others = (1, 1), (2, len(said.best))
    true_best, true_worst = np.array([first, *[others] * (len(said.best) - 1)]).T
    missed = bool((said.best > true_best).any() or (said.worst < true_worst).any())
    return Outcome(float(missed), 1, float(said.worst[0] == 1))


def filtered(rng: np.random.Generator, noise: Noise) -> Outcome:
    """Entrants of the true front that a filter sets aside; found are the others that it does."""
    truth = rng.standard_normal((OBJECTIVES, FIELD))
    most = FILTER.most_races
    costs = truth[:, :, None] - RUN_DEVIATION * noise.draw(rng, (OBJECTIVES, FIELD, most))
    struck = noise.struck(rng, (FIELD, most))
    costs = np.where(struck, costs.max(axis=(1, 2), keepdims=True), costs)
    valid = ~noise.void(rng, (FIELD, most))
    valid[:, 0] |= ~valid[:, : FILTER.races].any(axis=1)
    driven = np.full(FIELD, FILTER.races)
    names = [f"{number:02}" for number in range(FIELD)]
    while True:
        counted = valid & (np.arange(most) < driven[:, None])
        sizes = counted.sum(axis=1)
        measured = [
            Measured(names, group_sums(cost[counted], sizes) / sizes, cost[counted], sizes) for cost in costs
        ]
        probability = nondominated_probability(measured, FILTER.resamples, rng)
        again = undecided(probability) & (driven < most)
        if not again.any():
            break
        driven = np.where(again, 2 * driven, driven)
    kept = surviving(probability, FILTER.keep_probability)
    front = moocore.is_nondominated(np.ascontiguousarray(truth.T), keep_weakly=True)
    others = ~front
    return Outcome(
        float((front & ~kept).sum() / front.sum()),
        int(front.sum()),
        float((others & ~kept).sum() / others.sum()) if others.any() else None,
    )


def battery_ranks(rng: np.random.Generator, noise: Noise, gain: float) -> Ranks:
    """Ranks of entrants, of whom the first is better by so many points in every test."""
    shape = (SIX, TESTS, TEST_RUNS)
    points = POINTS + np.arange(TESTS)[:, None] / 3 + POINT_DEVIATION * noise.draw(rng, shape)
    points[0] += gain
    points[noise.struck(rng, shape)] = 0.0
    valid = ~noise.void(rng, shape).ravel()
    entrant, test, run = (axis.ravel() for axis in np.indices(shape))
    marks = pl.DataFrame(
        {
            "entrant": [f"{number}" for number in entrant],
            "test": [f"{number}" for number in test],
            "run": run,
            "measure": points.ravel(),
            "unit": ["1"] * len(run),
            "points": points.ravel(),
        },
        MARKS,
    ).filter(pl.Series(valid))
    ranked = rank_battery(marks, rng, resamples=2).sort("entrant")
    return Ranks(ranked["rank"].to_numpy(), ranked["worst_rank"].to_numpy())


def battery(rng: np.random.Generator, noise: Noise) -> Outcome:
    """Any of six equals ranked behind another."""
    return Outcome(float(battery_ranks(rng, noise, 0.0).best.max() > 1), 1, None)


def battery_ranges(rng: np.random.Generator, noise: Noise) -> Outcome:
    """See `ranges`."""
    return ranges(battery_ranks(rng, noise, FASTER))


def raced(rng: np.random.Generator, noise: Noise, gain: float) -> Ranks:
    """Ranks after a tournament in rounds of entrants, of whom the first scores more."""
    names = [f"{number}" for number in range(THREE)]
    stopping = Stopping(TOURNAMENT.effect, TOURNAMENT.drop)
    open_ = {frozenset(two) for two in combinations(names, 2)}
    results = pl.DataFrame(schema=RESULTS)
    rounds = -(-TOURNAMENT.pairs // TOURNAMENT.block)
    for number in range(rounds):
        drawn = [
            _pairs(rng, noise, first, second, number, gain if first == "0" else 0.0)
            for first, second in combinations(names, 2)
            if frozenset((first, second)) in open_
        ]
        if not drawn:
            break
        results = pl.concat([results, *drawn])
        open_ -= settled(results, stopping, EQUAL)
    evidence = Evidence(results, EQUAL)
    return Ranks(*possible_ranks(better(evidence, 1 - repeated(CONFIDENCE, rounds))))


def _pairs(
    rng: np.random.Generator, noise: Noise, first: str, second: str, number: int, gain: float
) -> pl.DataFrame:
    """RESULTS of a round of mirrored pairs of two."""
    pairs = TOURNAMENT.block
    gaps: Floats = gain + PAIR_DEVIATION * noise.draw(rng, (pairs,))
    gaps = np.where(noise.struck(rng, (pairs,)), -SWEPT, gaps)
    gaps = np.where(noise.struck(rng, (pairs,)), SWEPT, gaps)
    void = noise.void(rng, (pairs, 2))
    rows = [
        {
            "match": f"{first} {second} {number}",
            "test": "4v4",
            "race": 2 * pair + mirror,
            "seed": 100 * number + pair,
            "mirrored": bool(mirror),
            "car": car,
            "entrant": (first, second)[car],
            "points": 18.1 + (0.5 - car) * gaps[pair],
            "ending": "interrupted" if void[pair, mirror] else "finished",
            "contacts": 0,
            "distance_m": 1000.0,
        }
        for pair in range(pairs)
        for mirror in (0, 1)
        for car in (0, 1)
    ]
    return pl.DataFrame(rows, RESULTS)


def round_robin(rng: np.random.Generator, noise: Noise) -> Outcome:
    """Any of three equals ranked behind another."""
    return Outcome(float(raced(rng, noise, 0.0).best.max() > 1), 1, None)


def round_robin_ranges(rng: np.random.Generator, noise: Noise) -> Outcome:
    """See `ranges`."""
    return ranges(raced(rng, noise, STRONGER))


def cases() -> Iterator[Case]:
    """All of filter, battery and round robin."""
    for noise in NOISES:
        yield Case("filter", "loses of the front", noise.name, 0.10, partial(filtered, noise=noise))
        yield Case("battery", EQUALS, noise.name, 0.05, partial(battery, noise=noise))
        yield Case("battery", RANGES, noise.name, 0.05, partial(battery_ranges, noise=noise))
        yield Case("round robin", EQUALS, noise.name, 0.05, partial(round_robin, noise=noise))
        yield Case("round robin", RANGES, noise.name, 0.05, partial(round_robin_ranges, noise=noise))
