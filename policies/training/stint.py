"""Stints: rollouts on a pair of circuit and car, which gives way to another after a while."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.policy import Policy
from nathlon.policies.training.config import Rollouts, TrainingConfig
from nathlon.policies.training.pairs import PairDraw
from nathlon.policies.training.rewards import Rewards
from nathlon.policies.training.rollout import Rollout, Step


@dataclass
class RolloutTally:
    """What happened in some steps of rollouts.

    Attributes:
        laps: lap times driven, s.
        steps: steps of single cars.
        driven_s, off_course_s: time driven by the learner's cars, and that off course, s.
        components: sum of each component of the reward over those steps, unweighted.
    """

    laps: list[float] = field(default_factory=list)
    steps: int = 0
    driven_s: float = 0.0
    off_course_s: float = 0.0
    components: dict[str, float] = field(default_factory=dict)

    def add(self, other: RolloutTally) -> None:
        """Take in another tally."""
        self.laps += other.laps
        self.steps += other.steps
        self.driven_s += other.driven_s
        self.off_course_s += other.off_course_s
        for name, value in other.components.items():
            self.components[name] = self.components.get(name, 0.0) + value


class RolloutStint:
    """Races of some rollouts on one pair at a time."""

    def __init__(
        self, config: TrainingConfig, rollouts: Rollouts, draw: PairDraw, rng: np.random.Generator
    ) -> None:
        """Races at their start, on a pair that is drawn.

        Raises:
            InputError: if the rollouts cannot be made.
        """
        self._config, self._rollouts, self._draw, self._rng = config, rollouts, draw, rng
        self._met: tuple[Policy | None, Sequence[Path]] = None, ()
        self._begin()
        # The first ones are of different length, so that worlds do not change all at once.
        if config.variety is not None:
            self._left_s *= rng.uniform(0.2, 1.0)

    def _begin(self) -> None:
        self._pair = self._draw.draw(self._rng)
        self._rollout = Rollout(self._config, self._rollouts, self._pair, self._rng)
        self._rollout.meet(*self._met)
        self._driven = RolloutTally()
        self._left_s = np.inf if self._config.variety is None else self._config.variety.stint_s

    @property
    def observation(self) -> NDArray[np.float32]:
        """What the learner's cars see; see `Rollout.observation`."""
        return self._rollout.observation

    @property
    def hidden(self) -> NDArray[np.float32]:
        """What the learner's critics see instead; see `Rollout.hidden`."""
        return self._rollout.hidden

    def meet(self, current: Policy | None, past: Sequence[Path]) -> None:
        """Let the opponents be what they are called; see `Rollout.meet`."""
        self._met = current, past
        self._rollout.meet(current, past)

    def step(self, action: NDArray[np.float32]) -> tuple[Step, RolloutTally]:
        """Advance all races by one step; the last one of a stint cuts off all episodes.

        Args:
            action: (slots, 2) of the learner.
        """
        step, components = self._rollout.step(action)
        tally = _tally(self._rollout, step, components)
        self._driven.add(tally)
        self._left_s -= self._rollout.episodes.step_s
        if self._left_s <= 0.0:
            step = step._replace(truncated=step.valid & ~step.terminated)
            if self._driven.driven_s and self._rollout.tells_pace:
                speed = self._driven.components["progress"] / self._driven.driven_s
                self._draw.note(self._pair, speed)
            self._begin()
        return step, tally


def _tally(rollout: Rollout, step: Step, components: dict[str, Rewards]) -> RolloutTally:
    """What happened in the last step of a rollout; demonstrations tell nothing of the learner."""
    laps, rollout.laps = rollout.laps, []
    driven_s, rollout.driven_s = rollout.driven_s, 0.0
    off_course_s, rollout.off_course_s = rollout.off_course_s, 0.0
    if rollout.demonstrated:
        return RolloutTally()
    sums = {name: float(value[step.valid].sum()) for name, value in components.items()}
    return RolloutTally(laps, int(step.valid.sum()), driven_s, off_course_s, sums)
