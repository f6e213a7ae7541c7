"""The simulated world and its face for multi-agent reinforcement learning."""

from __future__ import annotations

from typing import TYPE_CHECKING

if __name__ != "nathlon.sim":
    raise ModuleNotFoundError("import nathlon.sim instead of sim", name="sim")

if TYPE_CHECKING:
    from nathlon.sim.observation import ObservationSpec
    from nathlon.sim.race_env import RaceEnv


def parallel_env(
    circuit: str = "lindenring",
    car: str = "gt3",
    scenario: str = "race",
    observation: ObservationSpec | None = None,
    render_mode: str | None = None,
) -> RaceEnv:
    """A race as a PettingZoo parallel environment; see `nathlon.sim.race_env.RaceEnv`.

    Args:
        circuit, car, scenario: shipped names or paths of `.toml` files.
        observation: what the agents see; the default has 60 course points.
        render_mode: None, `rgb_array` (`render` gives pictures) or `human` (a window).

    Raises:
        InputError: if a name is unknown, a file is wrong, or there is no display for a window.
    """
    # Here, so that importing the package does not load the compiler.
    from nathlon.sim.race_env import RaceEnv

    return RaceEnv(circuit, car, scenario, observation, render_mode)
