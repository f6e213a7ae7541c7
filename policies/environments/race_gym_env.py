"""The Gymnasium face of the world: one car, alone or against opponents."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from nathlon.policies.environments.opponents import load_opponents, single_seat
from nathlon.policies.policy import Policy
from nathlon.sim.episode import Episodes, action_space, in_space, info_of, observation_space
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.render import RENDER_MODES, open_screen

Observation = Any
"""(size,) float32; with a camera a dict of `picture` and `sensors`."""


class RaceGymEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """`nathlon/Race-v0` and `nathlon/TimeTrial-v0`: steps, spaces and reward as in
    `nathlon.sim.race_env.RaceEnv`.

    The default scenarios start anywhere on the lap and are truncated after 150 s, which shows a
    learner the whole circuit from the first episode.
    """

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES}  # noqa: RUF012  # declared so by the base class

    def __init__(
        self,
        circuit: str = "lindenring",
        car: str = "gt3",
        scenario: str = "1v3",
        opponents: Sequence[str | Policy] = ("driver:pace=0.9",),
        place: int | None = None,
        observation: ObservationSpec | None = None,
        render_mode: str | None = None,
    ) -> None:
        """An environment.

        Args:
            circuit, car, scenario, observation, render_mode: as of `nathlon.sim.parallel_env`.
            opponents: who drive the other cars in turn, by name (see `nathlon.policies.load`) or themselves.
            place: the agent's starting place, 1 is the first; None for the last.

        Raises:
            InputError: if a name is unknown, a file is wrong, there is no such place, nobody drives
                the other cars, or there is no display for a window.
        """
        spec = observation or ObservationSpec()
        self._episodes = Episodes(circuit, car, scenario)
        self._env = single_seat(self._episodes, place, spec, load_opponents(opponents, circuit, car))
        self._car = int(self._env.cars[0])
        self.observation_space = observation_space(spec)
        self.action_space = action_space()
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": 1.0 / self._episodes.step_s}
        others = self._episodes.scenario.cars - 1
        names = [_name(opponents[turn % len(opponents)]) for turn in range(others)]
        names.insert(self._car, "agent")
        self._screen = open_screen(render_mode, self._episodes, names, self._car)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a new run.

        Args:
            seed: of the starts from here on; without it they go on from the last seed.
            options: none are known.
        """
        super().reset(seed=seed)
        self._env.start([0], [self.np_random])
        if self._screen:
            self._screen.start()
        return in_space(self._env.seen[0]), self._info()

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Advance by a step, 0.1 s unless the scenario has another action rate.

        Args:
            action: (2,) float32.

        Raises:
            ValueError: if the action is not finite.
        """
        reward = float(self._env.step(np.reshape(action, (1, 2)))[0])
        if self._screen:
            self._screen.step()
        ending = self._episodes.endings[0, self._car]
        terminated, truncated = bool(ending in ("finished", "stuck")), bool(ending == "time_up")
        return in_space(self._env.seen[0]), reward, terminated, truncated, self._info()

    def _info(self) -> dict[str, Any]:
        return info_of(self._episodes.facts(), 0, self._car)

    def render(self) -> NDArray[np.uint8] | None:
        """The race from above, the agent in the middle: (600, 800, 3) uint8, or None in a window."""
        return self._screen.render() if self._screen else None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._screen:
            self._screen.close()


def _name(opponent: str | Policy) -> str:
    if isinstance(opponent, str):
        return PurePath(opponent).name.removesuffix(".safetensors")
    return type(opponent).__name__.lower()
