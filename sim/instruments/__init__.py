"""What expressions can say of racing cars: quantities of one agent step, read from the states around it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from nathlon.sim.car import Car
from nathlon.sim.expressions import Quantity, Values
from nathlon.sim.instruments.dashboard import AMONG_CARS, INSTRUMENTS
from nathlon.sim.instruments.moment import MeasuredStep, Transition
from nathlon.sim.track import Track

__all__ = ["AMONG_CARS", "QUANTITIES", "Instruments", "Transition"]

QUANTITIES: Mapping[str, Quantity] = {name: instrument.quantity for name, instrument in INSTRUMENTS.items()}
"""All that can be read, by name."""


class Instruments:
    """Reads quantities of cars of one model on one circuit."""

    def __init__(self, track: Track, car: Car, step_s: float) -> None:
        """Instruments.

        Args:
            track: the circuit.
            car: the model that all drive.
            step_s: length of an agent step, s.
        """
        self.track = track
        self._car, self._step_s = car, step_s

    def read(self, names: Iterable[str], step: Transition) -> dict[str, Values]:
        """Some of QUANTITIES in a step by name, each (races, cars) float64."""
        moment = MeasuredStep(self.track, self._car, self._step_s, step)
        return {name: np.asarray(INSTRUMENTS[name].read(moment), np.float64) for name in names}
