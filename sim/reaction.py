"""How often cars act, and how late and how clearly they see."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.camera_spec import MOST_BLUR, MOST_NOISE
from nathlon.sim.clock import DYNAMICS_HZ
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.world import World


class Haze(NamedTuple):
    """What lies before all cameras; see `CameraSpec`.

    Attributes:
        blur: how often each pixel is mixed with its neighbours, besides.
        noise: standard deviation of each number, besides.
    """

    blur: int = 0
    noise: float = 0.0

    def before(self, spec: ObservationSpec) -> ObservationSpec:
        """What is seen through it; numbers stay clear."""
        camera = spec.camera
        if camera is None or not any(self):
            return spec
        blur = min(camera.blur + self.blur, MOST_BLUR)
        noise = min(math.hypot(camera.noise, self.noise), MOST_NOISE)
        return replace(spec, camera=replace(camera, blur=blur, noise=noise))


CLEAR = Haze()


@dataclass(frozen=True, eq=False)
class Reaction:
    """The rates of the cars of a race, in dynamics steps of 1/60 s, and what they see through.

    Attributes:
        period: (cars,) int64, steps from action to action.
        delay: (cars,) int64, steps from what happens to when it is seen.
        haze: before all cameras.
    """

    period: NDArray[np.int64]
    delay: NDArray[np.int64]
    haze: Haze = CLEAR

    @classmethod
    def of(cls, action_hz: NDArray[np.float64], delay_s: NDArray[np.float64], haze: Haze = CLEAR) -> Reaction:
        """Rates from actions a second and delays in s, each (cars,)."""
        period = np.round(DYNAMICS_HZ / action_hz).astype(np.int64)
        return cls(period, np.round(delay_s * DYNAMICS_HZ).astype(np.int64), haze)

    @property
    def tick(self) -> int:
        """The longest step of the world that meets every action and every delay."""
        return math.gcd(*self.period.tolist(), *self.delay.tolist())


class Perception:
    """What some cars of a world see, each as late as its delay says."""

    def __init__(
        self,
        spec: ObservationSpec,
        races: NDArray[np.int64],
        cars: NDArray[np.int64],
        reaction: Reaction,
    ) -> None:
        """Nothing has been seen yet.

        Args:
            spec: what to observe.
            races, cars: (n,) indices of the cars.
            reaction: of all cars of a race.
        """
        self._spec, self._races, self._cars = reaction.haze.before(spec), races, cars
        self._tick = reaction.tick
        self._late = reaction.delay[cars] // self._tick
        self._depth = int(self._late.max(initial=0)) + 1
        self._period = reaction.period[cars]
        self._seen: NDArray[Any] | None = None
        self._new = np.zeros(len(races), np.bool_)

    def forget(self, races: Collection[int]) -> None:
        """See the present of some races when next they are seen, as at their start."""
        self._new |= np.isin(self._races, list(races))

    def keep(self, rows: NDArray[np.bool_]) -> None:
        """See with some of the cars only from now on, those of `rows`, (n,)."""
        self._races, self._cars = self._races[rows], self._cars[rows]
        self._late, self._period, self._new = self._late[rows], self._period[rows], self._new[rows]
        if self._seen is not None:
            self._seen = self._seen[:, rows]

    def due(self, world: World) -> NDArray[np.bool_]:
        """Which of the cars act now, (n,)."""
        return world.ticks[self._races] % self._period == 0

    def see(self, world: World) -> NDArray[Any]:
        """What the cars see now, as of `World.observe`; to be called once a tick.

        A car that has not driven for as long as its delay sees its start.
        """
        now = world.observe(self._spec, self._races, self._cars)
        if self._depth == 1:
            return now
        if self._seen is None:
            self._seen = np.repeat(now[None], self._depth, axis=0)
        new = self._new | (world.ticks[self._races] == 0)
        self._seen[:, new] = now[new]
        self._new[:] = False
        rows = np.arange(len(now))
        at = world.ticks[self._races] // self._tick
        self._seen[at % self._depth, rows] = now
        return self._seen[(at - self._late) % self._depth, rows]
