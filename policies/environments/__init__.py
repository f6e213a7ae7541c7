"""The environments that Gymnasium makes by name."""

from __future__ import annotations

from typing import Any

import gymnasium

ENVIRONMENTS: dict[str, dict[str, Any]] = {
    "nathlon/TimeTrial-v0": {"scenario": "1v0", "opponents": ()},
    "nathlon/Race-v0": {},
}
"""Names, and the arguments in which they differ from `RaceGymEnv`."""


def register_environments() -> None:
    """Make the environments known to Gymnasium."""
    for name, arguments in ENVIRONMENTS.items():
        gymnasium.register(
            name,
            entry_point="nathlon.policies.environments.race_gym_env:RaceGymEnv",
            vector_entry_point="nathlon.policies.environments.race_vector_env:RaceVectorEnv",
            kwargs=arguments,
        )
