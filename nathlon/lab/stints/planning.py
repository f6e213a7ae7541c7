"""The fastest plan of each number of stops, on a clear road, and how sure that is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.lab.stints.model import FUEL, START, STOP, LapModel, stint_model
from nathlon.policies.stint_model import service_s
from nathlon.policies.stint_search import NextStint, Rest, StintSearch
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

    Args:
        model: of the laps.
        laps: of the race.
        pit: what a stop takes.
        capacity_kg: of the tank.
        most_stops: of a plan.

    Raises:
        InputError: if no number of stops is enough.
    """
    search = StintSearch(stint_model(model), pit, capacity_kg)
    rests = search.rests(laps, most_stops)
    walked = [_walk(search, laps, rests[: stops + 1]) for stops in range(most_stops + 1)]
    found = [_plan(model, stints, pit) for stints in walked if stints]
    if not found:
        raise InputError(
            f"{laps} laps: no plan of {most_stops} stops or fewer, each stint at most {model.ages} laps, "
            "expected more stops"
        )
    return sorted(found, key=lambda plan: plan.seconds(model))


def _walk(search: StintSearch, laps: int, rests: Sequence[Rest]) -> list[NextStint]:
    """The stints of the fastest plan; `rests` are what the rest takes with none, one... of them."""
    *fewer, last = rests
    first = search.first(laps, last)
    if first is None:
        return []
    stints, left = [first], laps - first.laps
    for rest in reversed(fewer):
        fuel_kg = stints[-1].fuel_kg - stints[-1].used_kg
        following = search.after_stop(left, fuel_kg, rest)
        assert following is not None, "a first stint has others that complete it"
        stints.append(following)
        left -= following.laps
    return stints


def _plan(model: LapModel, stints: Sequence[NextStint], pit: PitParameters) -> StopPlan:
    counts = np.zeros(len(model.coefficients))
    counts[START], counts[STOP] = 1.0, len(stints) - 1
    left_kg, stood_s = 0.0, 0.0
    for number, stint in enumerate(stints):
        compound = model.compounds.index(stint.compound)
        fuel_kg = max(stint.fuel_kg, left_kg) if number else stint.fuel_kg
        if number:
            stood_s += float(service_s(pit, True, np.array(fuel_kg - left_kg)))
        used = model.used_kg[compound, : stint.laps]
        counts += model.tyres(compound, stint.laps)
        counts[FUEL] += stint.laps * fuel_kg - float((np.cumsum(used) - used).sum())
        left_kg = fuel_kg - float(used.sum())
    told = tuple(Stint(laps=one.laps, compound=one.compound, fuel_kg=one.fuel_kg) for one in stints)
    return StopPlan(told, counts, stood_s)
