"""The world on a CUDA device: the same functions as on the CPU, compiled by Numba for the GPU.

A thread advances one race, or fills in one observation. Results differ from the CPU's by rounding:
the device fuses multiplications and additions elsewhere and has its own sines.
"""

# mypy: disable-error-code="attr-defined"
# What stands for the device in a kernel is not in Numba's types.

from __future__ import annotations

import numpy as np
from numba import cuda, float64, int64
from numpy.typing import NDArray

from nathlon.sim.observation import ObservationSpec
from nathlon.sim.observe import observe_car
from nathlon.sim.world import SUBSTEPS, World, step_race

THREADS = 64
"""Threads of a block."""
MOST_SEEN = 19
"""Opponents on the lists of an observation, at most: all other cars of a race."""


@cuda.jit
def step_races(state, actions, ticks, touched, contacts, count, substeps, p, course, rates, rules):  # type: ignore[no-untyped-def]
    """Advance every race by some dynamics steps; see `nathlon.sim.world.step_races`."""
    race = cuda.grid(1)
    if race < len(state):
        tyres = cuda.local.array((3, 4), float64)
        step_race(
            state[race],
            actions[race],
            ticks[race:],
            touched[race],
            contacts[race],
            count[race:],
            substeps,
            tyres,
            p,
            course,
            rates,
            rules,
        )


@cuda.jit
def observe_cars(state, races, cars, out, mean, scale, points, horizon, ahead, behind, p, course):  # type: ignore[no-untyped-def]
    """Fill in observations; see `nathlon.sim.observe.observe_cars`."""
    row = cuda.grid(1)
    if row < len(races):
        nearest = cuda.local.array(MOST_SEEN, int64)[: ahead + behind]
        distance = cuda.local.array(MOST_SEEN, float64)[: ahead + behind]
        observe_car(
            state[races[row]],
            cars[row],
            out[row],
            mean,
            scale,
            points,
            horizon,
            ahead,
            nearest,
            distance,
            p,
            course,
        )


class CudaWorld:
    """The races of a world, moved to the device as they stand."""

    def __init__(self, world: World) -> None:
        """Copies of the world's races.

        Raises:
            numba.cuda.CudaSupportError: if there is no device.
        """
        self._world = world
        self._parameters = world.parameters._replace(
            torque=cuda.to_device(world.parameters.torque),
            ratios=cuda.to_device(world.parameters.ratios),
            curve=cuda.to_device(world.parameters.curve),
        )
        self._course = world.course._replace(
            table=cuda.to_device(world.course.table),
            edges=cuda.to_device(world.course.edges),
            sectors=cuda.to_device(world.course.sectors),
        )
        self._races = [cuda.to_device(array) for array in world.arrays()]

    def step(self, actions: NDArray[np.floating], substeps: int = SUBSTEPS) -> None:
        """Advance all races; see `World.step`."""
        state, ticks, touched, contacts, count = self._races
        legal = cuda.to_device(np.clip(actions, -1.0, 1.0, dtype=np.float64))
        step_races[_blocks(len(state)), THREADS](
            state,
            legal,
            ticks,
            touched,
            contacts,
            count,
            substeps,
            self._parameters,
            self._course,
            self._world.rates,
            self._world.rules,
        )

    def observe(
        self, spec: ObservationSpec, races: NDArray[np.int64], cars: NDArray[np.int64]
    ) -> NDArray[np.float32]:
        """Standardised observations; see `World.observe`.

        Raises:
            ValueError: if the spec lists more than 19 cars.
        """
        if spec.cars_ahead + spec.cars_behind > MOST_SEEN:
            raise ValueError(f"the observation lists more than {MOST_SEEN} cars")
        mean, deviation = spec.scaling
        out = cuda.device_array((len(races), spec.size), np.float32)
        observe_cars[_blocks(len(races)), THREADS](
            self._races[0],
            cuda.to_device(races),
            cuda.to_device(cars),
            out,
            cuda.to_device(mean),
            cuda.to_device(np.float32(1.0) / deviation),
            spec.course_points,
            spec.horizon_s,
            spec.cars_ahead,
            spec.cars_behind,
            self._parameters,
            self._course,
        )
        return out.copy_to_host()

    def fetch(self) -> None:
        """Copy the races back into the world."""
        for array, on_device in zip(self._world.arrays(), self._races, strict=True):
            on_device.copy_to_host(array)


def _blocks(threads: int) -> int:
    return -(-threads // THREADS)
