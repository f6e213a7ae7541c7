"""A training run of Stable-Baselines3 among its siblings: `nathlon.NathlonCallback`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from nathlon.lab.siblings.run import TrainingRun


class NathlonCallback(BaseCallback):
    """Saves checkpoints, tells the store, and ends training when it is proved worse than a sibling.

        env = gymnasium.make("Pendulum-v1")
        callback = NathlonCallback("runs/pendulum", "seed-1", env, stop_if_worse_by=100)
        model.learn(100_000, callback=callback)

    Attributes:
        run: what it tells.
        stopped_at: the step at which it ended training; None where it has not.
    """

    def __init__(
        self,
        folder: str | Path,
        name: str,
        environment: Any,
        *,
        checkpoints: int = 20,
        episodes: int = 12,
        stop_if_worse_by: float | None = None,
    ) -> None:
        """See `nathlon.TrainingRun`.

        Args:
            folder: of all siblings.
            name: of this run.
            environment: of Gymnasium, in which policies are compared; not the one that is trained in.
            checkpoints: at equal distances.
            episodes: after each checkpoint, with greedy actions.
            stop_if_worse_by: returns of an episode that matter, as of `nathlon.TrainingRun`.

        Raises:
            InputError: if the folder cannot be written, or a number is not positive.
        """
        super().__init__()
        self.run = TrainingRun(folder, name, checkpoints=checkpoints, stop_if_worse_by=stop_if_worse_by)
        self.stopped_at: int | None = None
        self._environment, self._episodes, self._checkpoints = environment, episodes, checkpoints
        self._distance, self._next = 0, 0

    def _on_training_start(self) -> None:
        total, begun = self.locals["total_timesteps"], self.model.num_timesteps
        self._distance = max(1, (total - begun) // self._checkpoints)
        self._next = begun + self._distance

    def _on_step(self) -> bool:
        if self.num_timesteps < self._next:
            return True
        # Several environments step at once: all siblings call the checkpoint by the step that was due.
        step, self._next = self._next, self._next + self._distance
        returns = [self._episode(seed) for seed in self.run.seeds(step, self._episodes)]
        if statistics := self.model.get_vec_normalize_env():
            statistics.save(str(self.run.folder / f"policy_vecnormalize_{step}_steps.pkl"))
        worse = self.run.checkpoint(step, lambda path: self.model.save(path), returns)
        self.stopped_at = step if worse else None
        return not worse

    def _episode(self, seed: int) -> float:
        """The return of an episode."""
        normalisation = self.model.get_vec_normalize_env()
        seen, _ = self._environment.reset(seed=seed)
        memory, first, total, ended = None, np.ones(1, bool), 0.0, False
        while not ended:
            shown = seen if normalisation is None else normalisation.normalize_obs(seen)
            action, memory = self.model.predict(shown, memory, first, deterministic=True)
            seen, reward, terminated, truncated, _ = self._environment.step(action)
            total, first, ended = total + float(reward), np.zeros(1, bool), terminated or truncated
        return total
