"""Practice: a driver drives a line alone, and asks less grip of the places where that goes wrong.

The envelope is that of steady motion. What turning in, kerbs and crests take from it differs from place
to place: one share of the grip for the whole lap is too little in one bend and too much in another.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.driver.envelope import Envelope
from nathlon.policies.driver.speed_profile import Line, Profile, profile
from nathlon.policies.policy import Policy
from nathlon.sim.car import Car
from nathlon.sim.clock import AGENT_DT
from nathlon.sim.conditions import Start
from nathlon.sim.track import Track
from nathlon.sim.world import World

CARS = 26
"""Two of them begin on the grid, the others spread over the lap."""
PART = 0.4
"""Of a lap that each of them drives."""
START_SPEED = 0.85
"""Share of the profile's speed at which they begin."""
LONGEST_S = 300.0
"""Of a round: of a car that takes longer for its part of the lap, the rest is not practised."""
SETTLING_S = 2.0
"""From the start; who comes to grief until then does so because of it, in the middle of a bend, and is left
out."""
REAR_SLIP = 1.2
"""Mean slip angle of the rear tyres over that of their peak, from which the car is held to slide."""
ASTRAY_M = 1.3
"""From the line."""
BEFORE_S, AFTER_S = 2.5, 0.3
"""Before and after trouble the grip falls."""
EDGE_S = 0.5
"""In which the change fades."""
STEP = 0.015
LEAST_GRIP = 0.65
ROUNDS = 30
CLEAN_ROUNDS = 5
"""In a row, each from other places, before the practice ends."""
PolicyFor = Callable[[World, Profile], Policy]
"""Gives the policy that follows a profile in a world, and shows the world what that one must see."""


def _starts(track: Track, line: Profile, rng: np.random.Generator) -> list[Start]:
    """Two places on the grid, and places on the line spread over the lap."""
    rows, flying = len(line.offset), CARS - 2
    spread = (np.arange(flying) * rows // flying + rng.integers(0, rows // flying, flying)) % rows
    grid = track.grid
    facts = [(grid.pole_m, side * grid.lateral_m, 0.0, 0.0, np.inf) for side in (1.0, -1.0)]
    for row in spread:
        speed = START_SPEED * line.speed[row]
        facts.append((row * track.spacing, line.offset[row], line.heading[row], speed, np.inf))
    return [Start(*(np.array([fact], np.float64) for fact in start)) for start in facts]


def _trouble(
    track: Track, car: Car, line: Profile, policy_for: PolicyFor, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Rows at which a car slid, or left the line or the course, (rows,)."""
    world = World(track, car, CARS, 1)
    for race, start in enumerate(_starts(track, line, rng)):
        world.reset(race, start)
    driver = policy_for(world, line)
    memory, races, firsts = driver.initial_memory(CARS), np.arange(CARS), np.zeros(CARS, np.int64)
    cars = world.state[:, 0]
    peak = car.tyre.peak_slip_angle_rad[1]
    driving, trouble = np.ones(CARS, np.bool_), np.zeros(len(line.offset), np.bool_)
    for tick in range(round(min(PART * line.lap_s, LONGEST_S) / AGENT_DT)):
        actions, memory = driver.act(world.observe(driver.observation_spec, races, firsts), memory)
        world.step(actions[:, None])
        row = cars["row"].astype(np.int64)
        lost = (cars["off_course_s"] > 0.0) | (cars["wall_s"] > 0.0)
        slid = np.abs(cars["slip_angle"][:, 2:]).mean(axis=1) > REAR_SLIP * peak
        astray = np.abs(cars["lateral"] - line.offset[row]) > ASTRAY_M
        if tick * AGENT_DT < SETTLING_S:
            driving &= ~(lost | slid | astray)
        else:
            trouble[row[driving & (lost | slid | astray)]] = True
            driving &= ~lost
    return trouble


def _eased(grip: Line, line: Profile, trouble: NDArray[np.bool_]) -> Line:
    """Less grip around trouble, (rows,)."""
    time = np.concatenate([[0.0], np.cumsum(line.path.step / line.speed)[:-1]])
    fall = np.zeros(len(grip))
    for there in time[trouble]:
        until = (there - time + line.lap_s / 2) % line.lap_s - line.lap_s / 2
        near = np.minimum((BEFORE_S - until) / EDGE_S, (until + AFTER_S) / EDGE_S)
        fall = np.maximum(fall, np.clip(near, 0.0, 1.0))
    eased: Line = np.maximum(grip * (1.0 - STEP * fall), LEAST_GRIP)
    return eased


def practise(
    track: Track,
    car: Car,
    offset: Line,
    limits: Envelope,
    policy_for: PolicyFor,
    first_grip: float = 1.0,
    rounds: int = ROUNDS,
) -> Line:
    """The share of the grip to use at each row of the track table, (rows,).

    Args:
        track: the circuit.
        car: the car.
        offset: (rows,) of the line, m.
        limits: of the car.
        policy_for: who drives.
        first_grip: share of it to begin with.
        rounds: of practice, at most.
    """
    rng = np.random.default_rng(0)
    grip, clean = np.full(len(offset), first_grip), 0
    for _ in range(rounds):
        line = profile(track, offset, limits, grip)
        trouble = _trouble(track, car, line, policy_for, rng)
        clean = 0 if trouble.any() else clean + 1
        if clean == CLEAN_ROUNDS:
            break
        grip = _eased(grip, line, trouble)
    return grip
