"""The future of some cars, many times over: copies of their races in a world of their own.

The planned cars drive in the simulator itself. Their rivals are moved, along the way that they would take if
the policy drove everybody: it is driven once for all copies of a car, see `Outlook`. Rivals slow nobody and
push nobody, but they are seen, and touching them is noticed.
"""

from __future__ import annotations

from collections.abc import Iterator, Set
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.planning.prior import Prior
from nathlon.policies.planning.scene import Scene
from nathlon.policies.policy import Batch
from nathlon.sim.car import Car
from nathlon.sim.clock import AGENT_DT
from nathlon.sim.expressions import Readings
from nathlon.sim.instruments import AMONG_CARS, Instruments, Transition
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.state import CONTACT
from nathlon.sim.world import World

RIVALS = 4
"""Cars near the planned one that are foreseen with it."""
MOVED = (
    "x",
    "y",
    "yaw",
    "cos_yaw",
    "sin_yaw",
    "world_velocity_x",
    "world_velocity_y",
    "acceleration_x",
    "acceleration_y",
    "row",
    "progress",
    "lateral",
    "driving",
)
"""What is seen and told of a rival."""
NO_CONTACTS = np.zeros(0, CONTACT), np.zeros(0, np.int64)


class Group(NamedTuple):
    """Planned cars with the rivals near them.

    Attributes:
        state: (cars, 1 + rivals) CAR_STATE; the planned car is the first.
        ticks: (cars,) of their races.
    """

    state: NDArray[np.void]
    ticks: NDArray[np.int64]

    @classmethod
    def of(cls, scene: Scene, rivals: int) -> Group:
        """Those who drive first, the nearest before others."""
        world, rows = scene.world, np.arange(len(scene.races))
        state, length = world.state[scene.races], world.track.length
        gap = state["progress"] - state["progress"][rows, scene.cars][:, None]
        gap = np.abs(gap - np.round(gap / length) * length)
        gap[~state["driving"]] += length
        gap[rows, scene.cars] = -1.0
        chosen = np.argsort(gap, axis=1, kind="stable")[:, : 1 + rivals]
        start = state[rows[:, None], chosen]
        start["finish"] = np.inf
        return cls(start, world.ticks[scene.races])


class Outlook:
    """How groups go on if the policy drives all their cars."""

    def __init__(self, model: World, prior: Prior) -> None:
        """Nothing is foreseen yet; the model has a race for each group."""
        self._model, self._prior = model, prior
        count, cars = model.state.shape
        self._everybody = np.repeat(np.arange(count), cars), np.tile(np.arange(cars), count)

    def __call__(self, group: Group, steps: int) -> Iterator[NDArray[np.void]]:
        """The rivals after each of some steps of 0.1 s, (cars, rivals) CAR_STATE, not to be kept."""
        model = self._model
        model.state[:], model.ticks[:] = group.state, group.ticks
        for _ in range(steps):
            actions = self._prior(model.observe(self._prior.card.observation, *self._everybody)).mean
            # What the simulator has flung away stays where it is.
            actions = np.nan_to_num(actions, nan=0.0)
            model.step(actions.reshape(*model.state.shape, 2))
            yield model.state[:, 1:]


class Foresight:
    """Copies of the planned cars with the rivals near them, to be driven ahead; those of a car together."""

    def __init__(self, world: World, car: Car, cars: int, copies: int, prior: Prior) -> None:
        """Nothing is foreseen yet.

        Args:
            world: whose circuit, cars and conditions are those of the copies.
            car: the model that is planned.
            cars: that are planned.
            copies: of each.
            prior: drives the rivals.
        """
        self._rivals = min(RIVALS, world.state.shape[1] - 1)

        def model(races: int) -> World:
            copies = World(world.track, world.models, races, 1 + self._rivals, world.conditions, world.rules)
            for practised_by, plans in world.plans.items():
                copies.show(*plans, practised_by=practised_by)
            return copies

        self._model, self._outlook = model(cars * copies), Outlook(model(cars), prior)
        self._instruments = Instruments(world.track, car, AGENT_DT)
        self._own = np.arange(cars * copies), np.zeros(cars * copies, np.int64)
        self._actions = np.zeros((cars * copies, 1 + self._rivals, 2))
        self._copies = copies
        # By bytes, because records are copied field by field.
        self._before = np.empty_like(self._model.state)
        self._bytes = self._before.view(np.uint8), self._model.state.view(np.uint8)

    def begin(self, scene: Scene, steps: int) -> None:
        """Have all copies be as their cars are now, to be driven some steps."""
        group = Group.of(scene, self._rivals)
        self._model.state[:] = np.repeat(group.state, self._copies, axis=0)
        self._model.ticks[:] = np.repeat(group.ticks, self._copies)
        self._ways = self._outlook(group, steps)

    def observe(self, spec: ObservationSpec) -> Batch:
        """What is seen from the copies, (cars * copies, size)."""
        return self._model.observe(spec, *self._own)

    def step(self, actions: NDArray[np.floating], names: Set[str]) -> Readings:
        """Drive all copies for 0.1 s.

        Args:
            actions: (cars * copies, 2).
            names: of quantities to read.

        Returns:
            them by name, each (cars * copies,).
        """
        model, state, before = self._model, self._model.state, self._before
        np.copyto(*self._bytes)
        self._actions[:, 0] = actions
        state["driving"][:, 1:] = False
        model.step(self._actions)
        if self._rivals:
            self._move_rivals()
        among = names & AMONG_CARS
        readings = {
            **self._instruments.read(names - among, Transition(before[:, :1], state[:, :1], *NO_CONTACTS)),
            **self._instruments.read(among, Transition(before, state, *NO_CONTACTS)),
        }
        return {name: values[:, 0] for name, values in readings.items()}

    def _move_rivals(self) -> None:
        """Put the rivals where they are by now, and notice whom the planned cars touch."""
        state, way = self._model.state, next(self._ways)
        copies = state.reshape(len(way), self._copies, 1 + self._rivals)
        for name in MOVED:
            copies[name][:, :, 1:] = way[name][:, None]
        own, rivals = state[:, :1], state[:, 1:]
        dx, dy = rivals["x"] - own["x"], rivals["y"] - own["y"]
        body = self._model.car.body
        ahead = np.abs(dx * own["cos_yaw"] + dy * own["sin_yaw"]) < body.length_m
        aside = np.abs(dy * own["cos_yaw"] - dx * own["sin_yaw"]) < body.width_m
        state["car_contact"][:, 0] |= (ahead & aside & rivals["driving"]).any(axis=1)
