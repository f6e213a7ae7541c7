"""Environments whose reward is a formula over what their infos tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, SupportsFloat

import gymnasium
import numpy as np

from nathlon.sim.errors import InputError
from nathlon.sim.expressions import Quantity, pure_number

OWN = "reward"
"""Name of the environment's own reward in formulas."""


class FormulaReward(gymnasium.Wrapper):
    """Pays by an expression of numbers in the infos of a step; see `nathlon.sim.expressions`.

    Attributes:
        text: the expression.
    """

    def __init__(self, env: gymnasium.Env, text: str, quantities: Mapping[str, Quantity]) -> None:
        """An environment with another reward.

        Args:
            env: the environment.
            text: over `reward`, its own, and the quantities.
            quantities: numbers of its infos, by their keys, with units and ranges.

        Raises:
            InputError: if it is no expression of these, or has a unit.
        """
        super().__init__(env)
        own = Quantity("1", -1e6, 1e6, "of the environment")
        self._formula = pure_number(text, {OWN: own, **quantities})
        self.text = self._formula.text

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """A step, paid by the formula.

        Raises:
            InputError: if the infos lack a quantity of it, or it is no finite number.
        """
        observation, reward, terminated, truncated, info = self.env.step(action)
        seen = {OWN: reward, **info}
        readings = {}
        for name in self._formula.names:
            value = seen.get(name)
            if not isinstance(value, int | float | np.number) or not np.isfinite(value):
                raise InputError(
                    f"{self.text}: is to come from infos, where {name!r} is {value!r}, expected a number"
                )
            readings[name] = np.array(float(value))
        return observation, float(self._formula(readings)), terminated, truncated, info
