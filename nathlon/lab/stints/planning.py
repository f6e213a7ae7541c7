"""The fastest stints: dynamic programming over the laps of a race on a clear road."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.lab.stints.model import FUEL, START, STOP, LapModel
from nathlon.policies.stint_model import service_s
from nathlon.policies.stint_planner import SPARE_KG
from nathlon.policies.strategy import Stint
from nathlon.sim.errors import InputError
from nathlon.sim.rules import PitParameters


class StopPlan(NamedTuple):
    """A plan, and what it is expected to take.

    Attributes:
        stints: as of a composite.
        counts: (k,) of the model's coefficients.
        service_s: in the boxes, all stops together.
    """

    stints: tuple[Stint, ...]
    counts: NDArray[np.float64]
    service_s: float

    @property
    def stops(self) -> int:
        """How often it stops."""
        return len(self.stints) - 1

    def seconds(self, model: LapModel) -> float:
        """Expected race time, s."""
        return float(model.seconds(self.counts)) + self.service_s

    def behind(self, other: StopPlan, model: LapModel) -> tuple[float, float]:
        """How much slower it is than another, s, and half the width of a 95 % interval of that."""
        counts = self.counts - other.counts
        gap = float(model.seconds(counts)) + self.service_s - other.service_s
        return gap, float(model.half_width(counts[None])[0])


def plans(
    model: LapModel, laps: int, pit: PitParameters, capacity_kg: float, most_stops: int
) -> list[StopPlan]:
    """The fastest plan of each number of stops, the fastest first.

    Each stint begins with what fuel it needs: whoever carries the fuel of later stints is slower, and saves
    no service unless tyres are changed at the same time as fuel is filled in.

    Args:
        model: of the laps.
        laps: of the race.
        pit: what a stop takes.
        capacity_kg: of the tank.
        most_stops: of a plan.

    Raises:
        InputError: if no number of stops is enough.
    """
    steps = _steps(model, laps, pit, capacity_kg)
    # The fastest way through what is left of the race after so many laps, by how many stints it has.
    rest: list[Sequence[tuple[float, _Step | None]]] = [
        [(0.0 if left == 0 else np.inf, None) for left in range(laps + 1)]
    ]
    for _ in range(most_stops + 1):
        level = [
            min(
                (
                    (step.seconds(model, first=left == laps) + rest[-1][left - step.laps][0], step)
                    for step in steps
                    if step.laps <= left
                ),
                key=lambda way: way[0],
                default=(np.inf, None),
            )
            for left in range(laps + 1)
        ]
        rest.append(level)
    found = [
        _plan(model, laps, _walk(rest, laps, stints))
        for stints in range(1, most_stops + 2)
        if np.isfinite(rest[stints][laps][0])
    ]
    if not found:
        raise InputError(
            f"{laps} laps: no plan of {most_stops} stops or fewer, each stint at most {model.ages} laps, "
            "expected more stops"
        )
    return sorted(found, key=lambda plan: plan.seconds(model))


class _Step(NamedTuple):
    """A stint that may be part of a plan, with its service."""

    stint: Stint
    laps: int
    counts: NDArray[np.float64]
    service_s: float

    def seconds(self, model: LapModel, first: bool) -> float:
        """What it takes, s; the first begins on the grid, without a stop and its service."""
        taken = float(model.seconds(self.counts))
        return taken - float(model.coefficients[STOP]) if first else taken + self.service_s


def _steps(model: LapModel, laps: int, pit: PitParameters, capacity_kg: float) -> list[_Step]:
    steps = []
    for number, compound in enumerate(model.compounds):
        for length in range(1, min(model.ages, laps) + 1):
            used = model.used_kg[number, :length]
            fuel_kg = float(used.sum()) + SPARE_KG
            if fuel_kg > capacity_kg:
                break
            counts = model.tyres(number, length)
            counts[FUEL] = length * fuel_kg - float((np.cumsum(used) - used).sum())
            counts[STOP] = 1.0
            stint = Stint(laps=length, compound=compound, fuel_kg=round(fuel_kg, 1))
            steps.append(_Step(stint, length, counts, service_s(pit, True, float(used.sum()))))
    return steps


def _walk(rest: Sequence[Sequence[tuple[float, _Step | None]]], laps: int, stints: int) -> list[_Step]:
    chosen = []
    left = laps
    for level in range(stints, 0, -1):
        step = rest[level][left][1]
        assert step is not None, "a finite time has a first stint"
        chosen.append(step)
        left -= step.laps
    return chosen


def _plan(model: LapModel, laps: int, steps: list[_Step]) -> StopPlan:
    counts = np.sum([step.counts for step in steps], axis=0)
    counts[STOP] -= 1.0
    counts[START] = 1.0
    return StopPlan(tuple(step.stint for step in steps), counts, sum(step.service_s for step in steps[1:]))
