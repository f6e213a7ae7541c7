"""A driver that brakes early: whoever learns only against those who brake late will run into it."""

from __future__ import annotations

import numpy as np

from nathlon.policies.driver import Driver
from nathlon.policies.policy import Batch
from nathlon.sim.track import load_track


class EarlyBraker:
    """Drives as a driver does, but slows down for each corner some metres before it would.

    Args:
        driver: who steers, and says what the pedals would be further on.
        circuit: name of the circuit.
        early_m: how much earlier, m along the centre line.

    Its memory is the driver's.
    """

    def __init__(self, driver: Driver, circuit: str, early_m: float) -> None:
        self.observation_spec = driver.observation_spec
        self.reverse = driver.reverse
        self._driver = driver
        self._angle = 2.0 * np.pi * early_m / load_track(circuit).length
        self._progress = driver.observation_spec.slice("progress")
        others = [driver.observation_spec.slice(name) for name in ("cars_ahead", "cars_behind")]
        self._others = np.concatenate([np.arange(field.start, field.stop) for field in others])
        mean, deviation = driver.observation_spec.scaling
        self._nobody = -(mean / deviation)[self._others]

    def initial_memory(self, n: int) -> Batch:
        """See `Policy.initial_memory`."""
        return self._driver.initial_memory(n)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """See `Policy.act`."""
        further = observations.copy()
        sine, cosine = observations[:, self._progress].T
        further[:, self._progress.start] = sine * np.cos(self._angle) + cosine * np.sin(self._angle)
        further[:, self._progress.start + 1] = cosine * np.cos(self._angle) - sine * np.sin(self._angle)
        # What is seen of the others holds only here.
        further[:, self._others] = self._nobody
        pedals = self._driver.act(further, memory)[0][:, 0]
        actions, memory = self._driver.act(observations, memory)
        actions[:, 0] = np.minimum(actions[:, 0], pedals)
        return actions, memory
