"""The future of some cars, many times over: copies of their races in a world of their own.

The planned cars drive in the simulator itself. Their rivals are moved: each keeps the speed along the centre
line and the distance from it that it has now. They slow nobody and push nobody, but they are seen, and
touching them is noticed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.planning.scene import Scene
from nathlon.policies.policy import Batch
from nathlon.sim.expressions import Readings
from nathlon.sim.instruments import Instruments, Transition
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.state import CONTACT
from nathlon.sim.world import AGENT_DT, World

RIVALS = 4
"""Cars near the planned one that are foreseen with it."""
NO_CONTACTS = np.zeros(0, CONTACT), np.zeros(0, np.int64)


class Foresight:
    """Copies of the planned cars with the rivals near them, to be driven ahead; those of a car together."""

    def __init__(self, world: World, cars: int, copies: int) -> None:
        """Nothing is foreseen yet.

        Args:
            world: whose circuit, car and conditions are those of the copies.
            cars: that are planned.
            copies: of each.
        """
        rivals = min(RIVALS, world.state.shape[1] - 1)
        self._copies, self._track = copies, world.track
        self._model = World(world.track, world.car, cars * copies, 1 + rivals, world.conditions, world.rules)
        self._instruments = Instruments(world.track, world.car, AGENT_DT)
        self._own = np.arange(cars * copies), np.zeros(cars * copies, np.int64)
        self._actions = np.zeros((cars * copies, 1 + rivals, 2))
        self._steps = 0

    def begin(self, scene: Scene) -> None:
        """Have all copies be as their cars are now."""
        world, model = scene.world, self._model
        chosen = np.concatenate([scene.cars[:, None], self._nearest(scene)], axis=1)
        start = world.state[scene.races[:, None], chosen]
        # Rivals that do not drive are nowhere.
        self._rivals = start[:, 1:]["driving"].copy()
        start["finish"] = np.inf
        model.state[:] = np.repeat(start, self._copies, axis=0)
        model.ticks[:] = np.repeat(world.ticks[scene.races], self._copies)
        self._progress = start[:, 1:]["progress"].copy()
        self._lateral = start[:, 1:]["lateral"].copy()
        error = start[:, 1:]["heading_error"]
        self._speed = start[:, 1:]["velocity_x"] * np.cos(error) - start[:, 1:]["velocity_y"] * np.sin(error)
        self._steps = 0

    def observe(self, spec: ObservationSpec) -> Batch:
        """What is seen from the copies, (cars * copies, size)."""
        return self._model.observe(spec, *self._own)

    def step(self, actions: NDArray[np.floating], names: tuple[str, ...]) -> Readings:
        """Drive all copies for 0.1 s.

        Args:
            actions: (cars * copies, 2).
            names: of quantities to read.

        Returns:
            them by name, each (cars * copies,).
        """
        model, state = self._model, self._model.state
        before = state.copy()
        self._actions[:, 0] = actions
        state["driving"][:, 1:] = False
        model.step(self._actions)
        self._steps += 1
        self._move_rivals()
        readings = self._instruments.read(names, Transition(before, state, *NO_CONTACTS))
        return {name: values[:, 0] for name, values in readings.items()}

    def _nearest(self, scene: Scene) -> NDArray[np.int64]:
        """Indices of each car's rivals, (cars, rivals): those who drive first, the nearest before others."""
        state, length = scene.world.state[scene.races], self._track.length
        rows = np.arange(len(scene.races))
        gap = state["progress"] - state["progress"][rows, scene.cars][:, None]
        gap = np.abs(gap - np.round(gap / length) * length)
        gap[~state["driving"]] += length
        gap[rows, scene.cars] = np.inf
        return np.argsort(gap, axis=1, kind="stable")[:, : self._actions.shape[1] - 1]

    def _move_rivals(self) -> None:
        """Put the rivals where they are by now, and notice whom the planned cars touch."""
        if not self._rivals.shape[1]:
            return
        state, table = self._model.state, self._track.table
        progress = self._progress + self._speed * (self._steps * AGENT_DT)
        x, y, heading = self._track.pose(progress, self._lateral)
        along = np.mod(progress, self._track.length)
        row = np.minimum((along / self._track.spacing).astype(np.int64), len(table) - 1)
        cosine, sine = np.cos(heading), np.sin(heading)
        moved = {
            "x": x,
            "y": y,
            "yaw": heading,
            "cos_yaw": cosine,
            "sin_yaw": sine,
            "world_velocity_x": self._speed * cosine,
            "world_velocity_y": self._speed * sine,
            "acceleration_x": 0.0 * x,
            "acceleration_y": 0.0 * x,
            "progress": progress,
            "row": row,
            "driving": self._rivals,
        }
        for name, values in moved.items():
            state[name][:, 1:] = np.repeat(values, self._copies, axis=0)
        own, rivals = state[:, :1], state[:, 1:]
        dx, dy = rivals["x"] - own["x"], rivals["y"] - own["y"]
        body = self._model.car.body
        ahead = np.abs(dx * own["cos_yaw"] + dy * own["sin_yaw"]) < body.length_m
        aside = np.abs(dy * own["cos_yaw"] - dx * own["sin_yaw"]) < body.width_m
        state["car_contact"][:, 0] |= (ahead & aside & rivals["driving"]).any(axis=1)
