"""Compiling the kernels once for all workers: left to themselves, each would compile every one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nathlon.arena.job import Opening
from nathlon.arena.pool import Pool
from nathlon.arena.worlds.registry import RACING
from nathlon.policies.driver import Follower
from nathlon.policies.driver.envelope import envelope
from nathlon.policies.driver.speed_profile import profile
from nathlon.policies.load import load_policy
from nathlon.policies.sources import DRIVER
from nathlon.sim.car import load_car
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.track import load_track
from nathlon.sim.world import Start, World


def _step(circuit: str, car: str) -> None:
    _world(circuit, car).step(np.zeros((1, 1, 2), np.float32))


def _observe(circuit: str, car: str) -> None:
    world = _world(circuit, car)
    nobody = np.zeros(1, np.float64)[None]
    world.reset(0, Start(nobody, nobody, nobody, nobody, nobody))
    world.observe(ObservationSpec(), np.zeros(1, np.int64), np.zeros(1, np.int64))


def _drive(circuit: str, car: str) -> None:
    track, model = load_track(circuit), load_car(car)
    straight = np.zeros(len(track.table))
    line = profile(track, straight, envelope(model), np.ones(len(straight)))
    driver = Follower(track, model, 1.0, line)
    driver.act(np.zeros((1, driver.observation_spec.size), np.float32), driver.initial_memory(1))


def _practise(circuit: str, car: str) -> None:
    load_policy(DRIVER, circuit, car)


def _world(circuit: str, car: str) -> World:
    return World(load_track(circuit), load_car(car), 1, 1)


GROUPS = ((_step, _drive, _observe), (_practise,))
"""What is compiled side by side, that which takes longest first; practice needs all before it."""


def compile_kernels(
    pool: Pool, world: str, circuit: str, car: str, on_compiled: Callable[[int, int], None]
) -> None:
    """Have what races need on the disk: compiled kernels, then the driver's practice, which runs them.

    What is there already is only loaded. A circuit or car that cannot be driven is passed over: whoever
    enters a policy there says so. Other worlds than ours have no kernels.

    Args:
        pool: compiles.
        world, circuit, car: what is raced.
        on_compiled: told how many kernels are there, and how many there are in all.
    """
    if world != RACING:
        return
    done, total = 0, sum(map(len, GROUPS))
    on_compiled(done, total)
    for functions in GROUPS:
        pool.open([Opening(DRIVER, function, (circuit, car)) for function in functions])
        done += len(functions)
        on_compiled(done, total)
