"""What an actor does: it steps all rollouts, and gives back what each step brought.

Nothing here may load a kernel before the actor has said where those are kept; so the rest is imported late.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nathlon.sim.errors import InputError
from nathlon.sim.local_cache import keep_caches_here

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nathlon.policies.qrsac.recurrent import Network
    from nathlon.policies.training.config import TrainingConfig
    from nathlon.policies.training.on_ray.travel import Parcel
    from nathlon.policies.training.pairs import Pair
    from nathlon.policies.training.worker import Gathered, News, RolloutWorker


class Begin(NamedTuple):
    """What all actors of a run begin with.

    Attributes:
        code: fingerprint of the files that decide how races go, which must be the same here.
        config, pairs, network: as of `WorkerSetup`.
        parcels: files that these name.
    """

    code: str
    config: TrainingConfig
    pairs: Sequence[Pair]
    network: Network
    parcels: Sequence[Parcel]


class RolloutActor:
    """A rollout worker. Its calls are done in their order."""

    def __init__(self, name: str) -> None:
        """A worker without rollouts yet; `name` is for messages."""
        keep_caches_here()
        self._name = name
        self._worker: RolloutWorker

    def ready(self) -> None:
        """Tell that there is a process."""

    def begin(self, begin: Begin, seed: np.random.SeedSequence, news: News, *checkpoints: Parcel) -> None:
        """Make the rollouts; for `news` and `checkpoints` see `step`.

        Raises:
            InputError: if they cannot be made here.
        """
        import torch

        from nathlon.policies.training.on_ray.travel import Arrived
        from nathlon.policies.training.worker import RolloutWorker, WorkerSetup
        from nathlon.sim.decisive import fingerprint
        from nathlon.sim.process import HOST

        if fingerprint() != begin.code:
            raise InputError(f"{self._name} on {HOST}: has another nathlon, expected that of the learner")
        torch.set_num_threads(1)
        self._arrived = Arrived()
        self._arrived.unpack(begin.parcels)
        config, pairs = self._arrived.config(begin.config), self._arrived.pairs(begin.pairs)
        heard = self._heard(news, checkpoints)
        self._worker = RolloutWorker(WorkerSetup(config, pairs, begin.network, heard, seed))

    def step(self, news: News | None, *checkpoints: Parcel) -> Gathered:
        """Advance every rollout by one step; observations are in half precision, as the learner keeps them.

        Args:
            news: to be heard before; None if there are none.
            checkpoints: of the run, which have not come yet.
        """
        if news is not None:
            self._worker.hear(self._heard(news, checkpoints))
        gathered = self._worker.step()
        halves = [
            experience._replace(
                observation=_half(experience.observation),
                step=experience.step._replace(next_observation=_half(experience.step.next_observation)),
            )
            for experience in gathered.experience
        ]
        return gathered._replace(experience=halves)

    def _heard(self, news: News, checkpoints: Sequence[Parcel]) -> News:
        from pathlib import Path

        self._arrived.unpack(checkpoints)
        past = tuple(Path(self._arrived.place(str(path))) for path in news.past)
        # What Ray hands over cannot be written, which torch does not like.
        return news._replace(parameters=np.array(news.parameters), past=past)


def _half(observation: np.ndarray) -> np.ndarray:
    """Observations as a replay table of half precision keeps them."""
    most = np.finfo(np.float16).max
    return observation.clip(-most, most).astype(np.float16)
