"""Matrices whose cells have known truths: a fifth is worse, the others are as bad as the margin or alike."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from benchmarks.error_rates.noise import NOISES, Noise
from benchmarks.error_rates.simulation import Case, Outcome
from nathlon.arena.statistics import Floats
from nathlon.judge.matrix.evidence import (
    LOOKS_WORSE,
    TRIED_RUNS,
    discovered,
    looks,
    mishap,
    no_worse,
    p_worse,
    rate_of_look,
    shrink,
    variances_of_means,
)
from nathlon.selection.matrix_settings import MatrixSettings

SETTINGS = MatrixSettings()
SCENARIOS, PLACES = 15, 4
DEVIATION = 3.0
"""Of a difference of two runs, in margins."""
LARGEST = 6.0
"""Margins by which a cell is worse at most, beyond the margin."""
MISHAP, QUIET = 40.0, 0.5
"""Margins that a mishap of the baseline costs it, and the deviation of a run where it has such."""

Drive = Callable[[np.random.Generator, Noise, Floats, int], Floats]


def differences(rng: np.random.Generator, noise: Noise, truth: Floats, runs: int) -> Floats:
    """(cells, runs) margins by which the policy is worse; NaN where a run is void or somebody broke down.

    A skewed noise has its tail where the policy is much better: runs that the baseline spoils, and completes.
    """
    shape = (len(truth), runs)
    table = truth[:, None] + DEVIATION * noise.draw(rng, shape)
    gone = noise.void(rng, shape) | noise.struck(rng, shape) | noise.struck(rng, shape)
    return np.where(gone, np.nan, table)


def mishaps(rng: np.random.Generator, noise: Noise, truth: Floats, runs: int) -> Floats:
    """Likewise of a baseline that completes its mishaps, and of a policy that has none.

    In most runs the policy is worse, in a few far better, and `truth` is the mean of all.
    """
    shape = (len(truth), runs)
    spoilt = MISHAP * (noise.disasters - noise.struck(rng, shape))
    return np.asarray(truth[:, None] + spoilt + QUIET * noise.draw(rng, shape))


def called_worse(rng: np.random.Generator, noise: Noise, drive: Drive) -> Outcome:
    """Cells called worse that are not by more than the margin; found are those that are by far."""
    cells = SCENARIOS * PLACES
    kind = rng.uniform(size=cells)
    truth = np.where(kind < 0.2, 1.0 + LARGEST * rng.uniform(size=cells), np.where(kind < 0.6, 1.0, 0.0))
    levels = np.stack([np.repeat(np.arange(SCENARIOS), PLACES), np.tile(np.arange(PLACES), SCENARIOS)], 1)
    screened = drive(rng, noise, truth, SETTINGS.runs)
    known = np.flatnonzero(np.isfinite(screened).any(axis=1))
    some = screened[known]
    shrunk = shrink(np.nanmean(some, axis=1), variances_of_means(some), levels[known])
    suspects = known[shrunk.above(1.0) >= LOOKS_WORSE]
    ends = looks(SETTINGS.most_runs)
    drawn = drive(rng, noise, truth[suspects], ends[-1])
    worse, given_up = np.zeros((2, len(suspects)), np.bool_)
    runs = np.zeros(len(suspects), np.int64)
    for end in ends:
        runs[~worse & ~given_up] = end
        fresh = np.where(np.arange(ends[-1]) < runs[:, None], drawn, np.nan)
        everything = np.full((cells, SETTINGS.runs + ends[-1]), np.nan)
        everything[:, : SETTINGS.runs] = screened
        everything[suspects, SETTINGS.runs :] = fresh
        p = p_worse(fresh, 1.0, mishap(everything, 1.0))
        worse |= discovered(p, rate_of_look(end, ends, SETTINGS.false_discovery_rate))
        if end >= TRIED_RUNS:
            given_up |= no_worse(fresh, 1.0)
    really = truth[suspects] > 1.0
    large = truth > 1.0 + LARGEST / 2
    found = set(suspects[worse]) & set(np.flatnonzero(large))
    return Outcome(
        float((worse & ~really).sum() / max(worse.sum(), 1)),
        int(worse.sum()),
        len(found) / large.sum() if large.any() else None,
    )


def cases() -> Iterator[Case]:
    """All of the matrix."""
    for noise in NOISES:
        worse = partial(called_worse, noise=noise, drive=differences)
        yield Case("matrix", "called worse", noise.name, 0.05, worse)
        if noise.disasters:
            worse = partial(called_worse, noise=noise, drive=mishaps)
            yield Case("matrix", "called worse for the baseline's mishaps", noise.name, 0.05, worse)
