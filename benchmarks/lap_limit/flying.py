"""Flying laps of the built-in driver in the simulator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.driver import Driver
from nathlon.sim.car import load_car
from nathlon.sim.clock import AGENT_DT
from nathlon.sim.conditions import Start
from nathlon.sim.track import load_track
from nathlon.sim.world import World

LAPS = 3
"""The first from a rolling start, the others flying."""
START_SPEED = 25.0
SLOWEST = 15.0
"""m/s: who is slower on average does not finish."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FlyingLaps:
    """What the driver did alone on a circuit.

    Attributes:
        best_s: best flying lap, s; nan if there was none.
        off_course_s, wall_s: time off the course and at a wall in all laps, s.
        distance, speed, lateral: the last of the laps, tick by tick, m and m/s.
    """

    best_s: float
    off_course_s: float
    wall_s: float
    distance: Array
    speed: Array
    lateral: Array


def flying_laps(circuit: str, car: str) -> FlyingLaps:
    """Let the built-in driver drive alone at full pace."""
    track, driver = load_track(circuit), Driver(circuit, car)
    world = World(track, load_car(car), 1, 1)
    start = Start(*(np.array([value]) for value in (0.0, 0.0, 0.0, START_SPEED, LAPS * track.length)))
    world.reset(0, start)
    memory = driver.initial_memory(1)
    alone = np.zeros(1, np.int64)
    trace = []
    state = world.state[0, 0]
    for _ in range(round(LAPS * track.length / SLOWEST / AGENT_DT)):
        actions, memory = driver.act(world.observe(driver.observation_spec, alone, alone), memory)
        world.step(actions[:, None])
        trace.append((state["progress"], state["velocity_x"], state["lateral"]))
        if not state["driving"]:
            break
    progress, speed, lateral = np.array(trace).T
    last = (progress >= (LAPS - 1) * track.length) & (progress < LAPS * track.length)
    return FlyingLaps(
        best_s=float(state["best_lap_s"]),
        off_course_s=float(state["off_course_s"]),
        wall_s=float(state["wall_s"]),
        distance=progress[last] - (LAPS - 1) * track.length,
        speed=speed[last],
        lateral=lateral[last],
    )
