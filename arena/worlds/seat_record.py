"""What is seen of a seat in an episode of an environment, and what is measured of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from nathlon.arena.world import WorldError


@dataclass
class SeatRecord:
    """What has been seen of a seat in an episode.

    Attributes:
        total: sum of its rewards.
        steps: that it has made.
        terminated: whether the environment ended it, and not a time limit.
        info: its last one; what is in it stays when the seat leaves.
        infos: sums over its steps of the numbers in its infos.
    """

    total: float = 0.0
    steps: int = 0
    terminated: bool = False
    info: dict[str, Any] = field(default_factory=dict)
    infos: dict[str, float] = field(default_factory=dict)

    def note(self, reward: float, terminated: bool, info: Mapping[str, Any]) -> None:
        """Note what a step has told of it."""
        self.total += reward
        self.terminated = terminated
        self.info |= info
        for key, value in info.items():
            if isinstance(value, bool | int | float | np.number | np.bool_):
                self.infos[key] = self.infos.get(key, 0.0) + float(value)

    def number(self, name: str, measure: str, source: Source) -> float:
        """A number of the seat `name`, for a measure.

        Raises:
            WorldError: if it is to come from infos and does not.
        """
        if not isinstance(source, str):
            return float(source(self))
        if source not in self.info:
            raise WorldError(f"seat {name!r}: {measure} is to come from infos, where there is no {source!r}")
        return float(self.info[source])


Source = str | Callable[[SeatRecord], float]
"""Where a number of a seat comes from: a key of its last info, or a function of what was seen of it."""


@dataclass(frozen=True)
class Declared:
    """A measure that a world declares.

    Attributes:
        source: where it comes from.
        unit, goal: as of `Measure`; taken from `KNOWN` where the name is known there.
    """

    source: Source
    unit: str = "1"
    goal: Literal["min", "max"] = "max"
