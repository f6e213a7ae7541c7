"""Policies that installed packages offer for other environments than ours.

The entry point names a callable that takes the observation space and the action space, and returns what has
`initial_memory(n)` and `act(observations, memory)`. It is code, and is loaded only when a user names it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Space
from numpy.typing import NDArray

from nathlon.policies.general.outputs import IllegalActionError, Outputs
from nathlon.policies.general.policy import GeneralPolicy
from nathlon.policies.policy import Batch
from nathlon.policies.sources import PLUGIN
from nathlon.policies.sources.plugin import check_methods, make_plugin, plugin_id


class _CheckedObject:
    """What foreign code answers, which may be anything."""

    def __init__(self, policy: Any) -> None:
        self._policy = policy

    def initial_memory(self, n: int) -> Batch:
        return _numbers("memory", self._policy.initial_memory(n), n).astype(np.float32, copy=False)

    def act(self, observations: Batch, memory: Batch) -> tuple[NDArray[Any], Batch]:
        answer = self._policy.act(observations, memory)
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise IllegalActionError(f"act gives {type(answer).__name__}, expected actions and memory")
        actions, memory = (
            _numbers(what, value, len(observations))
            for what, value in zip(("actions", "memory"), answer, strict=True)
        )
        return actions, memory.astype(np.float32, copy=False)


def load_general_plugin(name: str, observation_space: Space[Any], action_space: Space[Any]) -> GeneralPolicy:
    """The policy that a package offers as `name`, made for two spaces.

    Raises:
        InputError: if no package or more than one offers it, or it is no policy.
    """
    made = make_plugin(name, observation_space, action_space)
    check_methods(name, made)
    return GeneralPolicy(
        source=f"{PLUGIN}:{name}",
        id=plugin_id(name),
        algorithm=PLUGIN,
        step=None,
        seed=None,
        observation_size=None,
        network=_CheckedObject(made),
        outputs=Outputs("clip", "choice"),
    )


def _numbers(what: str, value: Any, n: int) -> NDArray[Any]:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "iuf":
        found = value.dtype if isinstance(value, np.ndarray) else type(value).__name__
        raise IllegalActionError(f"{what} of {found}, expected an array of numbers")
    if value.ndim != 2 or len(value) != n:
        raise IllegalActionError(f"{what} of shape {value.shape}, expected ({n}, any number)")
    return value
