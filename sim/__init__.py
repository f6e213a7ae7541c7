"""The simulated world and its faces for reinforcement learning libraries.

Importing the package registers the Gymnasium environment `nathlon/TimeTrial-v0`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import gymnasium

if TYPE_CHECKING:
    from sim.observation import ObservationSpec
    from sim.race_env import RaceEnv

gymnasium.register("nathlon/TimeTrial-v0", entry_point="sim.time_trial_env:TimeTrialEnv")


def parallel_env(
    circuit: str = "lindenring",
    car: str = "gt3",
    scenario: str = "race",
    observation: ObservationSpec | None = None,
) -> RaceEnv:
    """A race as a PettingZoo parallel environment; see `sim.race_env.RaceEnv`.

    Args:
        circuit, car, scenario: shipped names or paths of `.toml` files.
        observation: what the agents see; the default has 60 course points.

    Raises:
        InputError: if a name is unknown or a file is wrong.
    """
    # Here, so that importing the package does not load the compiler.
    from sim.race_env import RaceEnv

    return RaceEnv(circuit, car, scenario, observation)
