"""The kernels that races need, each called once: that compiles it, or loads it where it is on the disk."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
from numba.core import event

from nathlon.policies.driver import Follower
from nathlon.policies.driver.envelope import envelope
from nathlon.policies.driver.speed_profile import profile
from nathlon.policies.load import load_policy
from nathlon.policies.mlp import FEW, Mlp
from nathlon.policies.sources import DRIVER
from nathlon.sim.car import load_car
from nathlon.sim.conditions import Start
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.track import load_track
from nathlon.sim.world import World


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


def _infer(circuit: str, car: str) -> None:
    layer = np.zeros((1, 1), np.float32), np.zeros(1, np.float32)
    for rows in (1, FEW + 1):
        Mlp((layer, layer), "relu", "clip")(np.zeros((rows, 1), np.float32))


def _practise(circuit: str, car: str) -> None:
    load_policy(DRIVER, circuit, car)


def _world(circuit: str, car: str) -> World:
    return World(load_track(circuit), load_car(car), 1, 1)


GROUPS = ((_step, _drive, _observe, _infer), (_practise,))
"""What is compiled side by side, that which takes longest first; practice needs all before it."""


class _Missing(Exception):
    """A kernel is not on the disk."""


class _Refusal(event.Listener):
    """Has nothing compiled."""

    def on_start(self, event: Any) -> None:
        raise _Missing

    def on_end(self, event: Any) -> None:
        pass


def load_kernels() -> None:
    """Load the kernels that are on the disk; one that is not is left to those who need it."""
    with event.install_listener("numba:compile", _Refusal()):
        for function in GROUPS[0]:
            with suppress(_Missing):
                function("lindenring", "gt3")  # they are the same for all
