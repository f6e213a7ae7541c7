"""The world on a CUDA device: the same functions as on the CPU, compiled by Numba for the GPU.

A thread advances one race, or fills in one observation. Results differ from the CPU's by rounding:
the device fuses multiplications and additions elsewhere and has its own sines.
"""

# mypy: disable-error-code="attr-defined"
# What stands for the device in a kernel is not in Numba's types.

from __future__ import annotations

from typing import Any

import numpy as np
from numba import cuda, float64, int64
from numpy.typing import NDArray

from nathlon.sim.clock import SUBSTEPS
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.observation_kernel import Nearby, observe_car
from nathlon.sim.observation_parameters import layout_parameters, view_parameters
from nathlon.sim.physics.tyre import Ground
from nathlon.sim.plan import UNPLANNED
from nathlon.sim.race_step import race_of, step_race
from nathlon.sim.world import World

THREADS = 64
"""Threads of a block."""
MOST_SEEN = 19
"""Opponents on the lists of an observation, at most: all other cars of a race."""


@cuda.jit
def step_races(races, actions, substeps, p):  # type: ignore[no-untyped-def]
    """Advance every race by some dynamics steps; see `nathlon.sim.race_step.step_races`."""
    index = cuda.grid(1)
    if index < len(races.cars):
        tyres = cuda.local.array((3, 4), float64)
        ground = Ground(tyres[0], tyres[1], tyres[2])
        step_race(race_of(races, index), actions[index], substeps, ground, p)


@cuda.jit
def observe_cars(state, races, cars, out, layout, listed, p):  # type: ignore[no-untyped-def]
    """Fill in observations with `listed` opponents; see `nathlon.sim.observation_kernel.observe_cars`."""
    row = cuda.grid(1)
    if row < len(races):
        nearest = cuda.local.array(MOST_SEEN, int64)[:listed]
        distance = cuda.local.array(MOST_SEEN, float64)[:listed]
        observe_car(state[races[row]], cars[row], out[row], layout, Nearby(nearest, distance), p)


class CudaWorld:
    """The races of a world, moved to the device as they stand."""

    def __init__(self, world: World) -> None:
        """Copies of the world's races.

        Raises:
            ValueError: if cars are of several models, or blue flags are shown.
            numba.cuda.CudaSupportError: if there is no device.
        """
        if len(world.models) > 1 or (world.rules and world.rules.blue_flags):
            raise ValueError("cars are of several models or are shown blue flags, expected neither")
        self._world = world
        self._parameters = _to_device(world.parameters)
        plan = world.plans[""][0].table if world.plans else UNPLANNED
        self._view = _to_device(view_parameters(world.parameters, plan))
        self._races = _to_device(world.arrays())

    def step(self, actions: NDArray[np.floating], substeps: int = SUBSTEPS) -> None:
        """Advance all races; see `World.step`."""
        legal = cuda.to_device(np.clip(actions, -1.0, 1.0, dtype=np.float64))
        blocks = _blocks(len(self._world.state))
        step_races[blocks, THREADS](self._races, legal, substeps, self._parameters)

    def observe(
        self, spec: ObservationSpec, races: NDArray[np.int64], cars: NDArray[np.int64]
    ) -> NDArray[np.float32]:
        """Standardised observations; see `World.observe`.

        Raises:
            ValueError: if the spec lists more than 19 cars.
        """
        listed = spec.cars_ahead + spec.cars_behind
        if listed > MOST_SEEN:
            raise ValueError(f"the observation lists more than {MOST_SEEN} cars")
        out = cuda.device_array((len(races), spec.size), np.float32)
        observe_cars[_blocks(len(races)), THREADS](
            self._races.cars,
            cuda.to_device(races),
            cuda.to_device(cars),
            out,
            _to_device(layout_parameters(spec)),
            listed,
            self._view,
        )
        return out.copy_to_host()

    def fetch(self) -> None:
        """Copy the races back into the world."""
        for array, on_device in zip(self._world.arrays(), self._races, strict=True):
            on_device.copy_to_host(array)


def _to_device(value: Any) -> Any:
    """A named tuple whose arrays are on the device, those of tuples in it too."""
    if isinstance(value, np.ndarray):
        return cuda.to_device(value)
    return type(value)(*map(_to_device, value)) if isinstance(value, tuple) else value


def _blocks(threads: int) -> int:
    return -(-threads // THREADS)
