"""Learning from mistakes: the state shortly before a loss of control becomes a start."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.episode import Episodes, Moment

EVERY_S = 1.0
KEPT = 4
"""Moments kept of the last seconds: a mistake is begun again from 3 to 4 s before."""
CAPACITY = 256
"""Mistakes remembered, the latest ones."""
ASTRAY_RAD = 0.9
"""Angle to the road from which a car is spinning."""
SLIDING_RAD = 0.5
"""Sideslip from which it is, unless it hardly moves."""
SLOW_M_S = 5.0
HARD_M_S = 10.0
"""Speed from which touching a wall is a mistake."""


def spinning(cars: NDArray[np.void]) -> NDArray[np.bool_]:
    """Which cars, CAR_STATE records of any shape, face away from the road or slide."""
    speed = np.hypot(cars["velocity_x"], cars["velocity_y"])
    sideslip = np.abs(np.arctan2(cars["velocity_y"], cars["velocity_x"]))
    return (np.abs(cars["heading_error"]) > ASTRAY_RAD) | ((sideslip > SLIDING_RAD) & (speed > SLOW_M_S))


def out_of_control(cars: NDArray[np.void]) -> NDArray[np.bool_]:
    """Which cars, CAR_STATE records of any shape, are spinning, off course, or at a wall at speed."""
    speed = np.hypot(cars["velocity_x"], cars["velocity_y"])
    crashed = cars["wall_contact"] & (speed > HARD_M_S)
    return cars["driving"] & (spinning(cars) | cars["off_course"] | crashed)


class Mistakes:
    """Moments before some cars lost control, of races that are watched step by step."""

    def __init__(self, episodes: Episodes, cars: NDArray[np.int64]) -> None:
        """No mistakes yet.

        Args:
            episodes: the races.
            cars: indices of the cars whose mistakes count, the same in every race.
        """
        self._episodes, self._cars = episodes, cars
        races = len(episodes.endings)
        self._lost = np.zeros((races, len(cars)), np.bool_)
        self._step = 0
        self._begun = np.zeros(races, np.int64)  # step in which each race was started
        self._period = max(round(EVERY_S / episodes.step_s), 1)
        self._recent: deque[tuple[int, Moment]] = deque(maxlen=KEPT)
        self._found: deque[Moment] = deque(maxlen=CAPACITY)

    def __len__(self) -> int:
        """Mistakes remembered."""
        return len(self._found)

    def watch(self) -> None:
        """Note what the last step brought; to be called after each step, before races are started."""
        self._step += 1
        lost = out_of_control(self._episodes.world.state[:, self._cars])
        for race in np.flatnonzero((lost & ~self._lost).any(axis=1)):
            self._note(int(race))
        self._lost = lost
        if self._step % self._period == 0:
            self._recent.append((self._step, self._episodes.moment()))

    def _note(self, race: int) -> None:
        if len(self._recent) < KEPT:
            return
        step, moment = self._recent[0]
        before = moment.of(race)
        if step >= self._begun[race] and not out_of_control(before.state[self._cars]).any():
            self._found.append(before)

    def restart(self, races: list[int]) -> None:
        """Take note that some races were started."""
        self._begun[races] = self._step
        self._lost[races] = False

    def draw(self, rng: np.random.Generator) -> Moment:
        """One of the moments, with equal chances."""
        return self._found[rng.integers(len(self._found))]
