"""The Gymnasium face of the world: one car alone on the circuit."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from sim.episode import Episode
from sim.errors import InputError
from sim.observation import ObservationSpec

Observation = NDArray[np.float32]


class TimeTrialEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """`nathlon/TimeTrial-v0`: one car alone; steps, spaces and reward as in `sim.race_env.RaceEnv`.

    The default scenario starts anywhere on the lap and is truncated after 150 s, which shows a
    learner the whole circuit from the first episode; `scenario="time_trial"` is one flying lap.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  # declared so by the base class

    def __init__(
        self,
        circuit: str = "lindenring",
        car: str = "gt3",
        scenario: str = "1v0",
        observation: ObservationSpec | None = None,
    ) -> None:
        """An environment; arguments as of `sim.parallel_env`.

        Raises:
            InputError: if a name is unknown, a file is wrong or the scenario is not for one car.
        """
        self._episode = Episode(circuit, car, scenario, observation)
        if self._episode.cars != 1:
            raise InputError(f"scenario {scenario!r} has {self._episode.cars} cars, expected one car alone")
        self.observation_space = self._episode.observation_space()
        self.action_space = self._episode.action_space()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a new run.

        Args:
            seed: of the starts from here on; without it they go on from the last seed.
            options: none are known.
        """
        super().reset(seed=seed)
        self._episode.start(self.np_random)
        return self._episode.observe()[0], self._episode.infos()[0]

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Advance by 0.1 s.

        Args:
            action: (2,) float32.

        Raises:
            ValueError: if the action is not finite.
        """
        reward = float(self._episode.step(np.reshape(action, (1, 2)))[0])
        ending = self._episode.endings[0]
        terminated, truncated = bool(ending in ("finished", "stuck")), bool(ending == "time_up")
        return self._episode.observe()[0], reward, terminated, truncated, self._episode.infos()[0]
