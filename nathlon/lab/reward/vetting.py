"""Which formulas are worth a training at all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.lab.reward.clips import Clips
from nathlon.lab.reward.library import DRIVER, STILL
from nathlon.policies.training.rollout import STUCK_S
from nathlon.sim.errors import InputError
from nathlon.sim.expressions import Expression, pure_number
from nathlon.sim.instruments import QUANTITIES

TYPICAL = 1.0
"""Mean magnitude of a step's reward for the built-in driver, after scaling: as of one made by hand."""
MOST = 1000.0
"""How many times that a single step may bring."""
LEAST = 1e-6
"""Spread of what steps bring, in such units, below which nothing can be learnt."""


class Vetted(NamedTuple):
    """A formula that may be trained.

    Attributes:
        expression: the formula.
        factor: that makes its scale that of all candidates.
    """

    expression: Expression
    factor: float


def vet(text: str, library: Mapping[str, Clips], gamma: float, step_s: float) -> Vetted:
    """The formula that a text says, if it can be learnt from.

    Args:
        text: an expression of `nathlon.sim.instruments.QUANTITIES`.
        library: clips by driver, among them `DRIVER` and `STILL`.
        gamma: discount a step.
        step_s: length of a step, s.

    Raises:
        InputError: if it is no such expression, is constant, explodes, or pays for standing still; says
            which.
    """
    expression = pure_number(text, QUANTITIES)
    steps = {name: _steps(expression, clips) for name, clips in library.items()}
    everything = np.concatenate(list(steps.values()))
    scale = float(np.abs(steps[DRIVER]).mean()) or float(np.abs(everything).mean())
    if not np.isfinite(everything).all():
        raise InputError("explodes: it is not finite in every step of the library's clips")
    if float(np.ptp(everything)) <= LEAST * max(scale, 1e-12):
        raise InputError("is constant: every step of the library's clips brings the same")
    largest = float(np.abs(everything).max())
    if largest > MOST * scale:
        raise InputError(
            f"explodes: a step of the library's clips brings {largest:.3g}, {largest / scale:,.0f} times "
            f"what is usual for the built-in driver, expected at most {MOST:,.0f} times"
        )
    still, driven = float(steps[STILL].mean()), float(steps[DRIVER].mean())
    # A run in training ends after some seconds at rest: then nothing more is to be lost either.
    until_stuck = still * (1.0 - gamma ** (STUCK_S / step_s)) / (1.0 - gamma) if gamma < 1.0 else still
    for_good = driven / (1.0 - gamma) if gamma < 1.0 else driven
    if still >= driven or until_stuck >= for_good:
        raise InputError(
            f"pays for standing still: {still:.3g} a step at rest, until the run ends, against {driven:.3g} "
            "a step for the built-in driver, expected more for driving"
        )
    return Vetted(expression, TYPICAL / scale)


def _steps(expression: Expression, clips: Clips) -> NDArray[np.float64]:
    """What every step brings, (n,); the first seconds of a car that is to stand count nothing."""
    values = np.broadcast_to(
        expression({name: clips.readings[name] for name in expression.names}), clips.driven.shape
    )
    there = clips.driven.copy()
    if clips.name == STILL:
        there &= clips.readings["speed"] < 0.1
    return np.asarray(values[there])
