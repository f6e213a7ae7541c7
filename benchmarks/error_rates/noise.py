"""The noises under which verdicts are judged: what a run shows beside the truth."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from nathlon.arena.statistics import Floats

Draw = Callable[[np.random.Generator, tuple[int, ...]], Floats]


class Noise(NamedTuple):
    """A kind of noise.

    Attributes:
        name: of it.
        draw: numbers of a shape with mean 0; their standard deviation is 1, or 0.
        disasters: share of the runs that go wrong altogether, whoever drives.
        voids: share of the runs that are void, by nobody's fault.
    """

    name: str
    draw: Draw
    disasters: float = 0.0
    voids: float = 0.0

    def struck(self, rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
        """Which runs go wrong."""
        return rng.uniform(size=shape) < self.disasters

    def void(self, rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
        """Which runs are void."""
        return rng.uniform(size=shape) < self.voids


def _normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    return rng.standard_normal(shape)


def _heavy(rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    """Student's t with three degrees of freedom."""
    return rng.standard_t(3, shape) / np.sqrt(3.0)


def _skewed(rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    """Mostly a little too good, and now and then much worse: an exponential tail on the bad side."""
    return 1.0 - rng.standard_exponential(shape)


def _none(rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    return np.zeros(shape)


NOISES = (
    Noise("normal", _normal),
    Noise("disasters in 0.5 %", _normal, disasters=0.005),
    Noise("disasters in 2 %", _normal, disasters=0.02),
    Noise("disasters in 5 %", _normal, disasters=0.05),
    Noise("heavy tails", _heavy),
    Noise("skewed", _skewed),
    Noise("exact ties", _none),
    Noise("voids in 5 %", _normal, voids=0.05),
)
