"""Points for a measured performance, as combined athletics events give them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Kind = Literal["time", "distance"]

BASE_POINTS = 500.0
REFERENCE_POINTS = 1000.0


@dataclass(frozen=True)
class Scoring:
    """points = factor * (threshold - time)^exponent, or factor * (distance - threshold)^exponent.

    The form of World Athletics' scoring tables for combined events, without their rounding down.
    In a `time` test less is better, in a `distance` test more. No points beyond the threshold.
    """

    kind: Kind
    factor: float
    threshold: float
    exponent: float

    @classmethod
    def through(cls, kind: Kind, base: float, reference: float, exponent: float) -> Scoring:
        """The scoring that gives 500 points to the mark `base` and 1000 points to `reference`.

        Raises ValueError where `reference` is not better than `base`, or the exponent not positive.
        """
        gain = base - reference if kind == "time" else reference - base
        if not (gain > 0 and exponent > 0):
            raise ValueError(
                f"a {kind} scoring needs a reference better than its base and a positive exponent, "
                f"not {reference}, {base} and {exponent}"
            )
        ratio = (REFERENCE_POINTS / BASE_POINTS) ** (1 / exponent)
        margin = gain / (ratio - 1)  # from the threshold to the base mark
        threshold = base + margin if kind == "time" else base - margin
        return cls(kind, BASE_POINTS / margin**exponent, threshold, exponent)

    def points(self, marks: ArrayLike) -> NDArray[np.float64]:
        """Points of each mark, in the shape of `marks`; NaN, a mark never set, gives 0."""
        marks = np.asarray(marks, dtype=np.float64)
        margin = self.threshold - marks if self.kind == "time" else marks - self.threshold
        return self.factor * np.fmax(margin, 0.0) ** self.exponent
