"""The trials of a round of polishing, one after another or in processes of their own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from nathlon.policies.policy import Policy
from nathlon.policies.training.config import Rollouts, TrainingConfig
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.processes import start_processes
from nathlon.policies.training.trial import Drive, Trial
from nathlon.sim.errors import InputError


class TrialSetup(NamedTuple):
    """A trial to be driven.

    Attributes:
        rollouts: of the configuration.
        pair: circuit and car.
        starts: how many differing ones.
        seed: of all that is drawn.
    """

    rollouts: Rollouts
    pair: Pair
    starts: int
    seed: int


class TrialPool:
    """Drives trials; how many processes do makes no difference but of rounding, where BLAS has threads."""

    def __init__(self, config: TrainingConfig, checkpoint: Path) -> None:
        """Processes, as many workers as the configuration has; without any, this one drives.

        Args:
            config: of which the rollouts are a part.
            checkpoint: drives where `self` and `past` do.
        """
        self._config, self._checkpoint = config, checkpoint
        self._processes = start_processes(config.workers) if config.workers else None

    def drive(self, plans: Sequence[TrialSetup], policy: Policy) -> Iterator[Drive]:
        """What comes of each of the trials, in their order.

        Args:
            plans: the trials.
            policy: drives.

        Raises:
            InputError: if a trial cannot be made, or a process has ended.
        """
        drive = partial(_drive, self._config, self._checkpoint, policy)
        if self._processes is None:
            yield from map(drive, plans)
            return
        try:
            yield from self._processes.map(drive, plans)
        except BrokenProcessPool:
            raise InputError(
                "polishing: a worker process has ended, expected it to drive its trials"
            ) from None

    def close(self) -> None:
        """End the processes."""
        if self._processes is not None:
            self._processes.shutdown(cancel_futures=True)


def _drive(config: TrainingConfig, checkpoint: Path, policy: Policy, plan: TrialSetup) -> Drive:
    trial = Trial(config, plan.rollouts, plan.pair, plan.starts, checkpoint)
    return trial.drive(policy, np.random.default_rng(plan.seed))
