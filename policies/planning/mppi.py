"""Model-predictive path integral control around a trained policy, after Residual-MPPI (Wang et al., 2024).

At each decision, sequences of deviations from the policy's own actions are drawn and driven ahead in the
simulator. Each is weighed by what the objective says of it, plus the logarithm of how probable the policy
holds its actions: that stands for everything that the policy was trained for. The car does the weighted mean.
"""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.planning.foresight import Foresight
from nathlon.policies.planning.prior import Actions, Prior
from nathlon.policies.planning.scene import Scene
from nathlon.policies.policy import Batch
from nathlon.sim.clock import AGENT_DT, DYNAMICS_HZ
from nathlon.sim.errors import InputError
from nathlon.sim.expressions import Expression
from nathlon.sim.world import World

SAMPLES, STEPS = 100, 15
"""Sequences that are drawn, and how many steps of 0.1 s they last."""
KNOTS = np.array([0, 3, 6, 9])
"""Steps at which deviations are drawn; they run straight between, and have ended STEPS_OUT later."""
STEPS_OUT = 3
SPREAD = np.array([0.25, 0.06])
"""Deviation of what is drawn for pedals and steering."""
OWN_SHARE = 0.1
"""Weight of the policy's log-probability: neighbouring steps say much the same."""

Floats = NDArray[np.float64]


class Mppi:
    """A policy that plans around another one.

    It must be shown the world, see `nathlon.policies.planning.decide`. Its memory is the plan of the last
    decision, from which the next one goes on: the race's clock then, and deviations at the knots.

    Attributes:
        id: of checkpoint and objective together.
    """

    def __init__(self, prior: Prior, identity: str, objective: Expression) -> None:
        """A planner.

        Args:
            prior: the policy around which it plans.
            identity: seeds what is drawn.
            objective: what is added to the policy's own aims, a pure number a step: 1 counts as much as a
                factor of e in probability.
        """
        self.observation_spec = prior.card.observation
        self.id = identity
        self._prior, self._objective = prior, objective
        self._seed = int(hashlib.sha256(identity.encode()).hexdigest()[:16], 16)
        self._names = frozenset(objective.names)
        self._between = _between(np.arange(float(STEPS)))
        # Scratch, kept because it is dear to make; nothing in it outlives a decision.
        self._scratch: tuple[World, int, Foresight] | None = None

    def initial_memory(self, n: int) -> Batch:
        """See `Policy.initial_memory`: no deviation from the policy."""
        return np.zeros((n, 1 + 2 * len(KNOTS)), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """Cannot be done without a world.

        Raises:
            InputError: always.
        """
        raise InputError("mppi: plans in the world itself, expected a race or an environment of nathlon's")

    def plan(self, scene: Scene, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """As `Policy.act`, in a world; cars that no longer drive get the policy's own actions."""
        own, memory = self._prior(observations), memory.copy()
        driving = scene.world.state["driving"][scene.races, scene.cars]
        if driving.any():
            shown = Scene(scene.world, scene.races[driving], scene.cars[driving])
            plan = self._improve(shown, Actions(*(part[driving] for part in own)), memory[driving])
            own.mean[driving] = np.clip(own.mean[driving] + plan[:, 0], -1.0, 1.0)
            memory[driving, 0] = shown.world.ticks[shown.races]
            memory[driving, 1:] = plan.reshape(len(plan), -1)
        return own.mean, memory

    def _improve(self, scene: Scene, actions: Actions, memory: Batch) -> Floats:
        """Deviations at the knots, (n, knots, 2), that are the mean of those drawn around the last plan's."""
        kept = self._kept(scene.world.ticks[scene.races], memory)
        drawn = kept[:, None] + self._noise(scene)
        drawn[:, 0] = 0.0
        score = self._drive(scene, drawn, actions)
        weight = np.exp(score - score.max(axis=1, keepdims=True))
        weight /= weight.sum(axis=1, keepdims=True)
        return np.einsum("ns,nskc->nkc", weight, drawn)

    def _noise(self, scene: Scene) -> Floats:
        """(n, samples, knots, 2), each with its opposite; the same for cars of races as far on."""
        ticks, which = np.unique(scene.world.ticks[scene.races], return_inverse=True)
        half = np.stack(
            [
                np.random.default_rng([self._seed, int(tick)]).standard_normal((SAMPLES // 2, len(KNOTS), 2))
                for tick in ticks
            ]
        )
        return (np.concatenate([half, -half], axis=1) * SPREAD)[which]

    def _drive(self, scene: Scene, drawn: Floats, actions: Actions) -> Floats:
        """What each of the drawn sequences is worth, (n, samples)."""
        n = len(scene.races)
        foresight = self._foresight(scene)
        foresight.begin(scene, STEPS)
        deviations = np.einsum("tk,nskc->tnsc", self._between, drawn).reshape(STEPS, n * SAMPLES, 2)
        score = np.zeros(n * SAMPLES)
        # What the car sees may be late: the policy acts on that.
        mean, deviation = (np.repeat(values, SAMPLES, axis=0) for values in actions)
        for step in range(STEPS):
            if step:
                mean, deviation = self._prior(foresight.observe(self.observation_spec))
            action = np.clip(mean + deviations[step], -1.0, 1.0)
            score -= OWN_SHARE * 0.5 * np.square((action - mean) / deviation).sum(axis=1)
            score += self._objective(foresight.step(action, self._names))
        # A car that the simulator has flung away has no future to choose.
        return np.where(np.isfinite(score), score, -1e12).reshape(n, SAMPLES)

    def _kept(self, ticks: NDArray[np.int64], memory: Batch) -> Floats:
        """What is left of the last plans, (n, knots, 2), at the knots counted from now."""
        since = (ticks - memory[:, 0]) / (DYNAMICS_HZ * AGENT_DT)
        plan = memory[:, 1:].astype(np.float64).reshape(len(memory), len(KNOTS), 2)
        return np.einsum("nlk,nkc->nlc", _between(since[:, None] + KNOTS), plan)

    def _foresight(self, scene: Scene) -> Foresight:
        world, cars = scene.world, len(scene.cars)
        if self._scratch is None or self._scratch[0] is not world or self._scratch[1] != cars:
            car = world.model(int(scene.races[0]), int(scene.cars[0]))
            self._scratch = world, cars, Foresight(world, car, cars, SAMPLES, self._prior)
        return self._scratch[2]


def _between(steps: NDArray[np.floating]) -> Floats:
    """Shares of the knots in the deviation of some steps, (*steps.shape, knots)."""
    at = [*KNOTS, KNOTS[-1] + STEPS_OUT]
    return np.stack([np.interp(steps, at, row) for row in np.eye(len(at))[:-1]], axis=-1)
