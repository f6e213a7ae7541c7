"""A training run among its siblings: `nathlon.TrainingRun`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from nathlon.arena.store import Store
from nathlon.lab.siblings.proof import proved_worse
from nathlon.policies.policy_file import content_id
from nathlon.selection.trials import draw_seeds
from nathlon.sim.errors import InputError
from nathlon.sim.names import file_stem
from nathlon.sim.whole_file import check_output, whole_file

KIND = "training"
"""Kind of log entry: a checkpoint of a training run."""
STORE = "store.sqlite"
GRACE = 0.25
"""Share of a run in which it is not stopped: curves cross early."""
SEED = 5_602_417
"""Of the episodes in which policies are compared."""


class Checkpoint(NamedTuple):
    """What the store knows of a checkpoint of a training run.

    Attributes:
        run: name of the training run.
        step: at which it was saved.
        returns: of its episodes, in the order of their seeds.
        stopped: whether the run ended there, as it was proved worse.
    """

    run: str
    step: int
    returns: tuple[float, ...]
    stopped: bool


class TrainingRun:
    """A training run that saves checkpoints, tells the store, and may end early.

    Runs in one folder are siblings: they train on the same task and have checkpoints at the same steps. They
    may train one after the other, or at the same time in several processes of this machine.
    """

    def __init__(
        self, folder: str | Path, name: str, *, checkpoints: int, stop_if_worse_by: float | None = None
    ) -> None:
        """Begin a run, or go on with one of this name.

        Args:
            folder: of all siblings; the store is in it, and a folder for each run.
            name: of the run.
            checkpoints: that it will have, at most.
            stop_if_worse_by: returns that matter: a run that is worse than a sibling by so much ends as soon
                as it shows, one that is as good goes on, others may do either; None never ends it.

        Raises:
            InputError: if the folder cannot be written, or a number is not positive.
        """
        if checkpoints < 1:
            raise InputError(f"checkpoints is {checkpoints}, expected at least 1")
        if stop_if_worse_by is not None and not stop_if_worse_by > 0:
            raise InputError(f"stop_if_worse_by is {stop_if_worse_by}, expected returns, more than 0")
        self.name, self.folder = name, Path(folder) / file_stem(name)
        check_output(self.folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self._store = Path(folder) / STORE
        self._checkpoints, self._margin = checkpoints, stop_if_worse_by

    def seeds(self, step: int, episodes: int) -> list[int]:
        """Seeds below 2^31 of the episodes after a step, the same for all siblings."""
        drawn = draw_seeds(np.random.SeedSequence((SEED, step)), episodes)
        return [seed % 2**31 for seed in drawn]

    def checkpoint(
        self, step: int, save: Callable[[Path], Any], returns: Sequence[float], ending: str = ".zip"
    ) -> bool:
        """Save a checkpoint and tell the store of it; whether the run is proved worse and should end.

        Args:
            step: how far training has come.
            save: writes the policy to the path that it is given.
            returns: of the episodes with the seeds of this step, in their order.
            ending: of the file.

        Raises:
            InputError: if a return is no finite number, or the store cannot be written.
            OSError: if the file cannot be written.
        """
        own = np.asarray(returns, float)
        if own.ndim != 1 or not np.isfinite(own).all():
            raise InputError(f"returns of {self.name} at step {step} are not a row of finite numbers")
        path = self.folder / f"policy_{step}_steps{ending}"
        with whole_file(path) as partial:
            save(partial)
        with Store(self._store) as store:
            known = checkpoints(store)
            worse = self._worse(known, step, own)
            entry = {"run": self.name, "step": step, "returns": own.tolist(), "stopped": worse}
            file = {"file": path.name, "digest": content_id(path.read_bytes())}
            store.append(KIND, entry | file)
        return worse

    def _worse(self, known: Iterable[Checkpoint], step: int, own: np.ndarray) -> bool:
        """By its siblings at the same step, but for those that were themselves stopped.

        The risk is that of as many looks as there are checkpoints: after these nothing is proved any more.
        """
        listed = list(known)
        # A run that was killed may come to a step twice.
        look = len({one.step for one in listed if one.run == self.name and one.step < step}) + 1
        if self._margin is None or not GRACE * self._checkpoints < look <= self._checkpoints:
            return False
        stopped = {one.run for one in listed if one.stopped}
        others = {one.run: np.array(one.returns) for one in listed if one.step == step}
        rivals = [returns for run, returns in others.items() if run not in stopped | {self.name}]
        return proved_worse(own, rivals, self._margin, self._checkpoints)


def checkpoints(store: Store) -> list[Checkpoint]:
    """All that training runs have told a store, in the order in which they did."""
    entries: list[Any] = [entry.entry for entry in store.log(KIND)]
    return [Checkpoint(one["run"], one["step"], tuple(one["returns"]), one["stopped"]) for one in entries]
