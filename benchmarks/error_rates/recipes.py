"""Recipes that are equal, and one that is better by two deviations of its runs."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from benchmarks.error_rates.noise import NOISES, Noise
from benchmarks.error_rates.simulation import Case, Outcome
from nathlon.arena.statistics import Floats
from nathlon.judge.recipes.statistics import probability_of_improvement
from nathlon.results.recipes import CONFIDENCE

RESAMPLES = 2000
SHAPES = ((5, 1), (5, 2), (5, 4), (10, 4))
"""Runs of each recipe, and references that they race."""
WITHIN = 0.3
"""Deviation from reference to reference of a run, in those from run to run."""
COLLAPSE = 10.0
"""By which a run is worse that went wrong altogether."""
BETTER = 2.0


def runs(rng: np.random.Generator, noise: Noise, shape: tuple[int, int], gain: float) -> Floats:
    """(runs, references) scores; a run that went wrong did so against all references, a void one is none."""
    count, references = shape
    whole = gain + noise.draw(rng, (count, 1)) - COLLAPSE * noise.struck(rng, (count, 1))
    scores = whole + WITHIN * noise.draw(rng, (count, references))
    return np.asarray(scores[~noise.void(rng, (count,))])


def says(rng: np.random.Generator, ours: Floats, theirs: Floats) -> int:
    """1 for surely better, -1 for surely worse, 0 for neither."""
    if not len(ours) or not len(theirs):
        return 0
    told = probability_of_improvement(ours, theirs, rng, RESAMPLES, CONFIDENCE)
    return int(told.low > 0.5) - int(told.high < 0.5)


def told_apart(rng: np.random.Generator, noise: Noise, shape: tuple[int, int]) -> Outcome:
    """A recipe called better or worse than its equal."""
    equal = says(rng, runs(rng, noise, shape, 0.0), runs(rng, noise, shape, 0.0))
    better = says(rng, runs(rng, noise, shape, BETTER), runs(rng, noise, shape, 0.0))
    return Outcome(float(equal != 0), 1, float(better > 0))


def cases() -> Iterator[Case]:
    """All of recipes."""
    for noise in NOISES:
        for shape in SHAPES:
            claim = f"equals differ, {shape[0]} runs, {shape[1]} references"
            yield Case("recipes", claim, noise.name, 0.05, partial(told_apart, noise=noise, shape=shape))
