"""The world on a CUDA device against the world on the CPU."""

from __future__ import annotations

import numpy as np
import pytest
from numba import cuda

from nathlon.sim.car import load_car
from nathlon.sim.cuda_world import CudaWorld
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track
from nathlon.sim.world import World

SPEC = ObservationSpec(course_points=12)
RACES = 3


def start() -> World:
    track, scenario = load_track("lindenring"), load_scenario("1v3")
    world = scenario.world(track, load_car("gt3"), RACES)
    for race in range(RACES):
        world.reset(race, scenario.place(track, np.random.default_rng(race)))
    return world


def drive(steps: int) -> tuple[World, World, float]:
    """The same races on CPU and device, and the largest difference of what is seen at the end."""
    host, copied = start(), start()
    device = CudaWorld(copied)
    rng = np.random.default_rng(0)
    for _ in range(steps):
        actions = rng.uniform(-0.3, 1.0, (*host.state.shape, 2)) * (1.0, 0.1)
        host.step(actions)
        device.step(actions)
    races, cars = np.indices(host.state.shape).reshape(2, -1)
    apart = np.abs(device.observe(SPEC, races, cars) - host.observe(SPEC, races, cars)).max()
    device.fetch()
    return host, copied, float(apart)


@pytest.mark.skipif(
    not cuda.is_available(),  # type: ignore[no-untyped-call]
    reason="Numba finds no CUDA device here",
)
def test_a_race_on_the_device_is_that_on_the_cpu_but_for_rounding() -> None:
    host, device, apart = drive(50)
    np.testing.assert_array_equal(device.ticks, host.ticks)
    for field, tolerance in (("progress", 1e-4), ("lateral", 1e-4), ("velocity_x", 1e-4), ("yaw", 1e-5)):
        np.testing.assert_allclose(device.state[field], host.state[field], rtol=0, atol=tolerance)
    assert apart < 1e-3
