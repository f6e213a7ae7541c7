"""The reward: a weighted sum of components over arrays of transitions (Wurman et al., 2022, table 1).

Penalties for leaving the road and touching the wall are charged on the speed that was brought
there, not on the speed that is left: otherwise the wall becomes a brake.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from sim.world import World

PASSING_AHEAD_M = 40.0
PASSING_BEHIND_M = 20.0
Rewards = NDArray[np.float64]


class RewardWeights(BaseModel):
    """Weights of the components; see the functions of the same names."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    progress: float = 0.2
    off_course: float = 0.006
    wall: float = 0.03
    wall_touch: float = 0.3
    tyre_slip: float = 0.0
    passing: float = 0.0
    contact: float = 0.0
    rear_end: float = 0.0


class Transition:
    """What a step of the world changed; take one before the step, then ask for its rewards after.

    All rewards are (races, cars).
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._before = world.state.copy()

    def progress(self) -> Rewards:
        """Metres of centre line gained, none while off course."""
        after = self._world.state
        return np.where(after["off_course"], 0.0, after["progress"] - self._before["progress"])

    def off_course(self) -> Rewards:
        """Minus time off course times the square of the speed before the step, s m^2/s^2."""
        return -(self._world.state["off_course_s"] - self._before["off_course_s"]) * self._speed_squared()

    def wall(self) -> Rewards:
        """Minus time at the wall times the square of the speed before the step, s m^2/s^2."""
        return -(self._world.state["wall_s"] - self._before["wall_s"]) * self._speed_squared()

    def wall_touch(self) -> Rewards:
        """-1 in contact with a wall."""
        return -self._world.state["wall_contact"].astype(np.float64)

    def tyre_slip(self) -> Rewards:
        """Minus the sum over tyres of min(abs(slip ratio), 1) times abs(slip angle)."""
        after = self._world.state
        slip = np.minimum(np.abs(after["slip_ratio"]), 1.0) * np.abs(after["slip_angle"])
        return -slip.sum(axis=2)

    def passing(self) -> Rewards:
        """Ground gained on each opponent within 20 m behind and 40 m ahead, m; ground lost counts alike."""
        before, after = self._before["progress"], self._world.state["progress"]
        length = self._world.track.length
        gap = before[:, None, :] - before[:, :, None]
        gap -= np.round(gap / length) * length
        gained = (after - before)[:, :, None] - (after - before)[:, None, :]
        near = (gap > -PASSING_BEHIND_M) & (gap < PASSING_AHEAD_M)
        near &= self._before["driving"][:, None, :] & ~np.eye(before.shape[1], dtype=np.bool_)
        return (gained * near).sum(axis=2)

    def contact(self) -> Rewards:
        """-1 in contact with a car."""
        return -self._world.state["car_contact"].astype(np.float64)

    def rear_end(self) -> Rewards:
        """Minus the square of the closing speed of contacts begun while behind and faster, m^2/s^2."""
        world = self._world
        penalty = np.zeros(world.state.shape)
        for race in np.flatnonzero(world.contact_count):
            for contact in world.new_contacts(int(race)):
                if contact["faster"] == contact["behind"]:
                    penalty[race, contact["behind"]] -= contact["closing"] ** 2
        return penalty

    def components(self) -> dict[str, Rewards]:
        """Every component, unweighted, by name."""
        return {name: getattr(self, name)() for name in RewardWeights.model_fields}

    def _speed_squared(self) -> Rewards:
        return self._before["velocity_x"] ** 2 + self._before["velocity_y"] ** 2


def total(components: dict[str, Rewards], weights: RewardWeights) -> Rewards:
    """The weighted sum of the components."""
    return np.sum([getattr(weights, name) * value for name, value in components.items()], axis=0)
