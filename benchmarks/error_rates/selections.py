"""Filters, batteries and round robins of entrants whose truth is known."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import combinations

import moocore
import numpy as np
import polars as pl

from benchmarks.error_rates.noise import NOISES, Noise
from benchmarks.error_rates.simulation import Case, Outcome
from nathlon.arena.results import RESULTS
from nathlon.arena.statistics import Floats, group_sums
from nathlon.selection.battery.ranking import MARKS, rank_battery
from nathlon.selection.pareto import nondominated_probability
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

LOOKED_FOR = 0.3
"""Share of the round robins in which a better one is looked for as well: they take longest."""


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
    kept = probability >= FILTER.keep_probability
    front = moocore.is_nondominated(np.ascontiguousarray(truth.T), keep_weakly=True)
    others = ~front
    return Outcome(
        float((front & ~kept).sum() / front.sum()),
        int(front.sum()),
        float((others & ~kept).sum() / others.sum()) if others.any() else None,
    )


def battery_ranks(rng: np.random.Generator, noise: Noise, gain: float) -> list[int]:
    """Ranks of entrants in their order, of whom the first is better by so many points in every test."""
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
    return rank_battery(marks, rng, resamples=2).sort("entrant")["rank"].to_list()


def battery(rng: np.random.Generator, noise: Noise) -> Outcome:
    """Any of six equals ranked behind another; found is one that is better, alone in the first rank."""
    equal, one_better = (battery_ranks(rng, noise, gain) for gain in (0.0, FASTER))
    return Outcome(float(max(equal) > 1), 1, float(one_better[0] == 1 and min(one_better[1:]) > 1))


def raced(rng: np.random.Generator, noise: Noise, gain: float) -> np.ndarray:
    """(K, K) who is better than whom after a tournament in rounds, of whom the first scores more."""
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
    return better(evidence, 1 - repeated(CONFIDENCE, rounds))


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
    """Any of three equals ranked behind another; found, where it is looked for, is one better than both."""
    false = float(raced(rng, noise, 0.0).any())
    if rng.uniform() > LOOKED_FOR:
        return Outcome(false, 1, None)
    return Outcome(false, 1, float(raced(rng, noise, STRONGER)[0].sum() == THREE - 1))


def cases() -> Iterator[Case]:
    """All of filter, battery and round robin."""
    for noise in NOISES:
        yield Case("filter", "loses of the front", noise.name, 0.10, partial(filtered, noise=noise))
        yield Case("battery", "equals have ranks", noise.name, 0.05, partial(battery, noise=noise))
        yield Case("round robin", "equals have ranks", noise.name, 0.05, partial(round_robin, noise=noise))
