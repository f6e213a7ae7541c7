"""Environments paid by a formula over their infos."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

from nathlon import FormulaReward, Quantity
from nathlon.sim.errors import InputError

QUANTITIES = {"height": Quantity("m", 0.0, 10.0, "of the kite")}


class Kite(gymnasium.Env):
    """Flies as high as it is told."""

    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)
    action_space = gymnasium.spaces.Box(-100.0, 100.0, (1,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        return np.zeros(1, np.float32), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        info = {} if action[0] < 0 else {"height": action[0]}
        return np.zeros(1, np.float32), 2.0, False, False, info


def test_a_formula_pays_for_what_infos_tell() -> None:
    kite = FormulaReward(Kite(), "height / m + 0.5 * reward", QUANTITIES)
    kite.reset()
    assert kite.step(np.array([3.0], np.float32))[1] == pytest.approx(4.0)
    assert kite.step(np.array([50.0], np.float32))[1] == pytest.approx(11.0), "beyond its range is its bound"
    for action in (-1.0, np.nan):
        with pytest.raises(InputError, match="is to come from infos, where 'height' is"):
            kite.step(np.array([action]))


def test_a_formula_of_something_else_is_refused() -> None:
    with pytest.raises(InputError, match="expected a pure number"):
        FormulaReward(Kite(), "height", QUANTITIES)
    with pytest.raises(InputError, match="is no quantity"):
        FormulaReward(Kite(), "depth / m", QUANTITIES)
