"""Gates of time trials: a candidate that is worse by the margin, or breaks down, and one that is as good."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.error_rates.noise import NOISES, Noise
from benchmarks.error_rates.simulation import Case, Outcome
from nathlon.arena.decision import Decision
from nathlon.arena.statistics import Floats
from nathlon.judge.gate.questions import Errors
from nathlon.selection.gate_settings import GateSettings
from nathlon.tournament.completion import Completed, Completion
from nathlon.tournament.non_inferiority import Sample, least_deviation, together

SETTINGS = GateSettings()
DEVIATIONS = (0.5, 1.0, 3.0)
"""Of a lap difference, in margins: a gate draws one of them."""
FURTHER = 4
"""Times the runs of a clean sweep that a gate has where it asks for other rates than the default."""


class Runs(NamedTuple):
    """Runs of candidate and champion from the same starts, in the order in which they come.

    Attributes:
        gains: (N,) margins by which the candidate's lap is better.
        ours, theirs: (N,) whether the candidate and the champion broke down.
    """

    gains: Floats
    ours: np.ndarray
    theirs: np.ndarray


def judged(runs: Runs, errors: Errors, most: int) -> tuple[Decision, int]:
    """What a gate says in the end that looks after every block, and after how many runs."""
    lap = errors.of_mean(1.0, most, errors.sweep)
    completion = Completion(errors.breakdowns or 1.0, errors.alpha, errors.beta)
    said: dict[str, Decision] = {}
    for taken in range(errors.block, most + errors.block, errors.block):
        ours, theirs = runs.ours[:taken], runs.theirs[:taken]
        if "lap" not in said:
            whole = runs.gains[:taken][~ours & ~theirs]
            said["lap"] = lap.verdict(Sample.of(whole, least_deviation(1.0)))
        if "completion" not in said:
            counts = (int((ours & theirs).sum()), int((ours & ~theirs).sum()), int((theirs & ~ours).sum()))
            said["completion"] = completion.verdict(Completed(len(ours), *counts))
        verdict = together(list(said.values()))
        if verdict != Decision.CANNOT_TELL:
            return verdict, min(taken, most)
        said = {name: one for name, one in said.items() if one != Decision.CANNOT_TELL}
    return Decision.CANNOT_TELL, most


def drawn(rng: np.random.Generator, noise: Noise, most: int, gain: float, ours: float, theirs: float) -> Runs:
    """Runs of a candidate that gains so many margins a lap; both break down as often as is said."""
    void = noise.void(rng, (most,))
    gains = gain + rng.choice(DEVIATIONS) * noise.draw(rng, (most,))
    broke = rng.uniform(size=(2, most)) < np.array([[ours], [theirs]])
    return Runs(gains[~void], broke[0][~void], broke[1][~void])


def passes_the_worse(rng: np.random.Generator, noise: Noise) -> Outcome:
    """A pass of one that is worse: by the margin in laps, or by the breakdowns that matter."""
    rate = noise.disasters or SETTINGS.breakdowns or 0.05
    errors = Errors(SETTINGS.alpha, SETTINGS.beta, SETTINGS.block, rate)
    most = FURTHER * errors.sweep if noise.disasters else SETTINGS.runs
    gain = 0.0 if noise.disasters else -1.0
    worse, _ = judged(drawn(rng, noise, most, gain, noise.disasters, 0.0), errors, most)
    equal, _ = judged(drawn(rng, noise, most, 0.0, 0.0, 0.0), errors, most)
    return Outcome(float(worse == Decision.PASS), 1, float(equal == Decision.PASS))


def fails_an_equal(rng: np.random.Generator, noise: Noise) -> Outcome:
    """A fail of one that is as good, and breaks down as often as the champion."""
    errors = Errors(SETTINGS.alpha, SETTINGS.beta, SETTINGS.block, SETTINGS.breakdowns)
    runs = drawn(rng, noise, SETTINGS.runs, 0.0, noise.disasters, noise.disasters)
    equal, _ = judged(runs, errors, SETTINGS.runs)
    runs = drawn(rng, noise, SETTINGS.runs, -3.0, noise.disasters, noise.disasters)
    worse, _ = judged(runs, errors, SETTINGS.runs)
    return Outcome(float(equal == Decision.FAIL), 1, float(worse == Decision.FAIL))


def cases() -> Iterator[Case]:
    """All of the gate."""
    for noise in NOISES:
        yield Case("gate", "passes who is worse", noise.name, 0.05, partial(passes_the_worse, noise=noise))
        yield Case("gate", "fails who is as good", noise.name, 0.05, partial(fails_an_equal, noise=noise))
