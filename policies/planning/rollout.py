"""The built-in driver, which tries ways past others in copies of the race before it drives on.

A rollout algorithm (Sutton and Barto, 2nd edition, 8.10): each of some ways is driven ahead in the simulator
itself for a while, by the driver as it is from then on. The car does the mean of how they begin, weighted by
what they bring. Others are taken to be built-in drivers at RIVAL_PACE.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.driver import Driver, eased
from nathlon.policies.driver.knowledge import Ways, minding
from nathlon.policies.planning.foresight import Group
from nathlon.policies.planning.scene import Scene
from nathlon.policies.policy import Batch
from nathlon.sim.clock import AGENT_DT
from nathlon.sim.errors import InputError
from nathlon.sim.world import World

AHEAD_M, BEHIND_M = 60.0, 20.0
"""Along the road between centres: ways are tried where another car is no further ahead or behind."""
ASTRAY_RAD, SLOW_M_S = 0.5, 3.0
"""Who faces further away from the road, or is slower, gets back on its way first."""
RIVALS = 4
"""Cars near the planned one that are driven with it."""
RIVAL_PACE = 0.95
WAY_STEPS = 20
"""Of 0.1 s: after these all go on as the driver does."""
ASIDE_M = (0.0, 2.5, -2.5)
"""Ways lead so far to the left of where the car is."""
SLOWER = 0.9
"""Share of the pace at which they are tried besides."""
PLACE_M, NEAR_M = 20.0, 6.0
"""What half a place is worth, as way; cars within some NEAR_M are partly passed."""
SPEED_S = 0.5
"""What speed at the end is worth."""
CONTACT_M, FAULT_M, TOUCHING_M = 15.0, 10.0, 2.0
"""Cost of a contact, of one at fault besides, and of each step of touching."""
OFF_M_S, PENALTY_M_S = 30.0, 10.0
"""Cost of a second off the course or at a wall, and of one of penalty."""
SPIN_M, SPIN_RAD = 20.0, 0.6
"""Cost of facing so far away from the road at the end."""
FAVOUR_M = 0.3
"""By so much a way must be better than the driver's own."""

EQUAL_M = 4.0
"""A way that is worth so much less counts for a factor of e less in what the car does."""

Floats = NDArray[np.float64]


class RolloutDriver:
    """A driver that looks ahead.

    It must be shown the world, see `nathlon.policies.planning.decide`. Among others it gives up none of its
    grip to care. It remembers nothing, so that a policy that is taught by it sees all that it goes by. So it
    goes by where it is alone too, and leaves some circuits on which the built-in driver stays.
    """

    reverse = paced = True

    def __init__(self, circuit: str, car: str, pace: float, grip: float, temper: str, ahead_s: float) -> None:
        """A driver for a circuit and car.

        Args:
            circuit, car, pace, grip, temper: as of `Driver`.
            ahead_s: for how long ways are driven ahead, s.
        """
        self.driver = Driver(circuit, car, pace, grip=grip, temper=temper, care=1.0, remembers=False)
        self.observation_spec = self.driver.observation_spec
        self._rival = Driver(circuit, car, RIVAL_PACE, grip=grip)
        self._steps = round(ahead_s / AGENT_DT)
        # Scratch, kept because it is dear to make; nothing in it outlives a decision.
        self._scratch: tuple[World, World] | None = None

    def initial_memory(self, n: int) -> Batch:
        """See `Policy.initial_memory`: nothing is remembered."""
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Cannot be done without a world.

        Raises:
            InputError: always.
        """
        raise InputError(
            "driver: tries ways past others in the world itself with a rollout, "
            "expected a race or an environment of nathlon's"
        )

    def plan(self, scene: Scene, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """As `Policy.act`, in a world."""
        n = len(scene.cars)
        ways = minding(n, self.driver.pace)._replace(pace=self.driver.pace * _ease(scene))
        actions, _ = self.driver.follow(observations, self.driver.initial_memory(n), ways)
        near = np.flatnonzero(self._near(scene))
        if len(near):
            actions[near] = self._improve(Scene(scene.world, scene.races[near], scene.cars[near]), n)
        return actions, memory

    def _near(self, scene: Scene) -> NDArray[np.bool_]:
        """Which cars are on their way and have another one near, (n,)."""
        world, races, cars = scene
        rows, state = np.arange(len(cars)), world.state[races]
        own, length = state[rows, cars], world.track.length
        gap = state["progress"] - own["progress"][:, None]
        gap -= np.round(gap / length) * length
        there = (gap < AHEAD_M) & (gap > -BEHIND_M) & state["driving"]
        there[rows, cars] = False
        astray = (np.abs(own["heading_error"]) > ASTRAY_RAD) | (own["velocity_x"] < SLOW_M_S)
        return np.asarray(there.any(axis=1) & own["driving"] & ~astray)

    def _ways(self, aside: Floats) -> Ways:
        """What is tried for cars so far to the left of the line, (n, ways); the driver's own comes first."""
        own, n = self.driver.pace, len(aside)
        tried = [(True, np.zeros(n), own), (False, np.zeros(n), own)]
        tried += [(False, aside + metres, pace) for pace in (own, SLOWER * own) for metres in ASIDE_M]
        minds, shift, pace = zip(*tried, strict=True)
        return Ways(np.tile(minds, (n, 1)), np.stack(shift, axis=1), np.tile(pace, (n, 1)))

    def _improve(self, scene: Scene, most: int) -> Batch:
        """What some cars do, (n, 2): as the best ways begin.

        Args:
            scene: the cars.
            most: cars of which this may be asked at once.
        """
        group = Group.of(scene, min(RIVALS, scene.world.state.shape[1] - 1))
        ways = self._ways(self.driver.off_line(group.state[:, 0]))
        n, copies = ways.minds.shape
        model = self._copies(scene.world, most * copies, group.state.shape[1])
        model.state[: n * copies] = np.repeat(group.state, copies, axis=0)
        model.ticks[: n * copies] = np.repeat(group.ticks, copies)
        model.state["driving"][n * copies :] = False
        tried = Ways(ways.minds.reshape(-1), ways.shift.reshape(-1), ways.pace.reshape(-1))
        begun, worth = self._drive(model, tried, np.repeat(_ease(scene), copies))
        worth = worth.reshape(n, copies)
        worth[:, 0] += FAVOUR_M
        weight = np.exp((worth - worth.max(axis=1, keepdims=True)) / EQUAL_M)
        weight /= weight.sum(axis=1, keepdims=True)
        return np.einsum("nw,nwa->na", weight, begun.reshape(n, copies, 2)).astype(np.float32)

    def _copies(self, world: World, races: int, cars: int) -> World:
        if self._scratch is None or self._scratch[0] is not world or len(self._scratch[1].state) != races:
            copies = World(world.track, world.models, races, cars, world.conditions, world.rules)
            self._scratch = world, copies
        copies = self._scratch[1]
        copies.arrays().touched[:] = -np.inf
        return copies

    def _drive(self, model: World, ways: Ways, ease: Floats) -> tuple[Floats, Floats]:
        """How some ways begin, (n, 2), and what they are worth, (n,), in as many of the model's races.

        Args:
            model: whose first car of each race takes the way.
            ways: (n,).
            ease: (n,) by which paces are multiplied.
        """
        n, cars = len(ease), model.state.shape[1]
        state, before = model.state[:n], model.state[:n, 0].copy()
        spec, races, first = self.observation_spec, np.arange(n), np.zeros(n, np.int64)
        others = np.repeat(races, cars - 1), np.tile(np.arange(1, cars), n)
        ways = ways._replace(pace=ways.pace * ease)
        afterwards = minding(n, self.driver.pace)._replace(pace=self.driver.pace * ease)
        rivals = minding(len(others[0]), RIVAL_PACE)
        rivals = rivals._replace(pace=RIVAL_PACE * eased(Scene(model, *others).grips[0], np.array(False)))
        nothing, memory = self.driver.initial_memory(n), self._rival.initial_memory(len(others[0]))
        memory[:, 0] = self._rival.off_line(state[:, 1:].reshape(-1))
        actions, touching = np.zeros((*model.state.shape, 2)), np.zeros(n)
        for step in range(self._steps):
            way = ways if step < WAY_STEPS else afterwards
            actions[:n, 0] = self.driver.follow(model.observe(spec, races, first), nothing, way)[0]
            does, memory = self._rival.follow(model.observe(spec, *others), memory, rivals)
            actions[:n, 1:] = does.reshape(n, cars - 1, 2)
            if step == 0:
                begun = actions[:n, 0].copy()
            # What the simulator has flung away stays where it is.
            model.step(np.nan_to_num(actions, nan=0.0))
            touching += state["car_contact"][:, 0]
        return begun, _worth(before, state, touching, model.track.length)


def _ease(scene: Scene) -> Floats:
    """By what paces are multiplied in some cars, (n,)."""
    return eased(scene.grips[0], scene.flagged) * scene.pace


def _worth(before: NDArray[np.void], state: NDArray[np.void], touching: Floats, length: float) -> Floats:
    """What has come of some cars, m, (n,).

    Args:
        before: (n,) CAR_STATE of them.
        state: (n, 1 + rivals) CAR_STATE afterwards; they are the first.
        touching: (n,) steps in which they touched somebody.
        length: of a lap, m.
    """
    own = state[:, 0]

    def more(name: str) -> Floats:
        return np.asarray(own[name] - before[name], np.float64)

    gap = own["progress"][:, None] - state["progress"][:, 1:]
    places = np.tanh((gap - np.round(gap / length) * length) / NEAR_M).sum(axis=1)
    worth = more("progress") + SPEED_S * own["velocity_x"] + PLACE_M * places
    worth -= CONTACT_M * more("contacts") + FAULT_M * more("contacts_at_fault") + TOUCHING_M * touching
    worth -= OFF_M_S * (more("off_course_s") + more("wall_s")) + PENALTY_M_S * more("penalty_s")
    worth -= SPIN_M * (np.abs(own["heading_error"]) > SPIN_RAD)
    # A car that the simulator has flung away has no future to choose.
    return np.where(np.isfinite(worth), worth, -1e12)
