"""The Gymnasium vector face of the world: many races at once on the batched world."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from nathlon.policies.environments.opponents import load_opponents, single_seat
from nathlon.policies.policy import Policy
from nathlon.sim.episode import Episodes, action_space, in_space, observation_space
from nathlon.sim.observation import ObservationSpec

Observations = Any
"""(num_envs, size) float32; with a camera a dict of `picture` and `sensors`."""
Actions = NDArray[np.float32]
Flags = NDArray[np.bool_]


class RaceVectorEnv(VectorEnv[Observations, Actions, NDArray[Any]]):
    """`nathlon/Race-v0` and `nathlon/TimeTrial-v0` in numbers: one agent in each race.

    Race i with seed s goes as the single environment with seed s + i does, however many there are.
    A race that has ended starts again in the same step: `final_obs` and `final_info` among the infos
    tell of its end. Infos are arrays by name, with `_name` for where they hold.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int,
        circuit: str = "lindenring",
        car: str = "gt3",
        scenario: str = "1v3",
        opponents: Sequence[str | Policy] = ("driver:pace=0.9",),
        place: int | None = None,
        observation: ObservationSpec | None = None,
        threads: int = 1,
    ) -> None:
        """Environments.

        Args:
            num_envs: how many races.
            circuit, car, scenario, opponents, place, observation: as of the single environment; in
                each race the opponents begin one further on.
            threads: on which a step works; the results do not depend on them.

        Raises:
            InputError: if a name is unknown, a file is wrong, there is no such place, or nobody
                drives the other cars.
        """
        spec = observation or ObservationSpec()
        self._episodes = Episodes(circuit, car, scenario, num_envs, threads)
        self._env = single_seat(self._episodes, place, spec, load_opponents(opponents, circuit, car))
        self._rngs = [np.random.default_rng() for _ in range(num_envs)]
        self.num_envs = num_envs
        self.single_observation_space = observation_space(spec)
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Start all races anew.

        Args:
            seed: of the first race, the others follow by one; or one for each race. Without it
                the starts go on from the last seed.
            options: none are known.
        """
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        for race, own in enumerate(seeds or []):
            if own is not None:
                self._rngs[race] = np.random.default_rng(own)
        self._start(np.ones(self.num_envs, np.bool_))
        return in_space(self._env.seen), self._infos()

    def _start(self, which: Flags) -> None:
        races = np.flatnonzero(which).tolist()
        self._env.start(races, [self._rngs[race] for race in races])

    def step(
        self, actions: Actions
    ) -> tuple[Observations, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Advance all races by a step, 0.1 s unless the scenario has another action rate.

        Args:
            actions: (num_envs, 2) float32.

        Raises:
            ValueError: if an action is not finite.
        """
        reward = self._env.step(actions)
        ending = self._episodes.endings[self._env.races, self._env.cars]
        terminated, truncated = (ending == "finished") | (ending == "stuck"), ending == "time_up"
        over = terminated | truncated
        if not over.any():
            return in_space(self._env.seen), reward, terminated, truncated, self._infos()
        final_obs = np.full(self.num_envs, None, dtype=object)
        for race in np.flatnonzero(over):
            final_obs[race] = in_space(self._env.seen[race])
        final = {"final_obs": final_obs, "_final_obs": over, "_final_info": over}
        final_info = self._infos()
        final["final_info"] = {
            name: value & over if name.startswith("_") else value for name, value in final_info.items()
        }
        self._start(over)
        return in_space(self._env.seen), reward, terminated, truncated, {**self._infos(), **final}

    def _infos(self) -> dict[str, Any]:
        infos: dict[str, Any] = {}
        for name, values in self._episodes.facts().items():
            mine = values[self._env.races, self._env.cars]
            known = np.isfinite(mine) if mine.dtype.kind == "f" else np.ones(mine.shape, np.bool_)
            infos[name], infos[f"_{name}"] = mine, known.reshape(self.num_envs, -1).any(axis=1)
        return infos
