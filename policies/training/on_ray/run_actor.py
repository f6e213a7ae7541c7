"""What an actor does that trains: a whole run in a folder there, whose files are asked for meanwhile.

Nothing here may load a kernel before the actor has said where those are kept; so the rest is imported late.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from nathlon.sim.errors import InputError
from nathlon.sim.local_cache import keep_caches_here
from nathlon.sim.scratch import scratch_folder

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from nathlon.policies.training.config import TrainingConfig
    from nathlon.policies.training.log import Status
    from nathlon.policies.training.on_ray.travel import Parcel


class RunStart(NamedTuple):
    """What a run begins with, or goes on with.

    Attributes:
        code: fingerprint of the files that decide how races go, which must be the same here.
        config, seed: of the run.
        parcels: files that the configuration names.
        files: what the run has left before, by the place in its folder.
    """

    code: str
    config: TrainingConfig
    seed: int
    parcels: Sequence[Parcel]
    files: Mapping[str, bytes]


class Report(NamedTuple):
    """How a run is getting on.

    Attributes:
        status: None before the first updates.
        files: that are new or other ones since the last report, by the place in the folder of the run.
    """

    status: Status | None
    files: dict[str, bytes]


class RunActor:
    """A training run. `report` is called while `train` goes on, in another thread."""

    def __init__(self, name: str) -> None:
        """An actor without a run yet; `name` is for messages."""
        keep_caches_here()
        self._name = name
        self._folder = scratch_folder()
        self._told: dict[str, tuple[int, int]] = {}
        self._status: Status | None = None

    def train(self, start: RunStart) -> str:
        """Train to the end of the configuration; why the run diverged, or ''.

        Raises:
            InputError: if it cannot be trained here.
        """
        import torch

        from nathlon.policies.training.on_ray.travel import Arrived
        from nathlon.policies.training.trainer import Diverged, Trainer
        from nathlon.sim.decisive import fingerprint
        from nathlon.sim.process import HOST

        if fingerprint() != start.code:
            raise InputError(f"{self._name} on {HOST}: has another nathlon, expected that of the caller")
        torch.set_num_threads(1)
        arrived = Arrived()
        arrived.unpack(start.parcels)
        folder = Path(self._folder.name)
        trainer = Trainer.start(folder, arrived.config(start.config), start.seed)
        if start.files:
            for name, content in start.files.items():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).write_bytes(content)
            trainer = Trainer.resume(folder)
        try:
            trainer.run(self._note)
        except Diverged as error:
            return str(error)
        return ""

    def _note(self, status: Status) -> None:
        self._status = status

    def report(self) -> Report:
        """Where the run stands, and what it has written.

        But for its configuration, whose opponents lie elsewhere here, and the replay tables. The state is
        read first: what is beside it is then no older, though the run goes on meanwhile.
        """
        from nathlon.policies.training.run_folder import CONFIG_FILE
        from nathlon.policies.training.state import REPLAY_FILE, STATE_FILE

        folder = Path(self._folder.name)
        files = {}
        for path in sorted(folder.rglob("[!.]*"), key=lambda path: (path.name != STATE_FILE, path)):
            name, found = str(path.relative_to(folder)), path.stat()
            mark = found.st_mtime_ns, found.st_size
            if path.is_dir() or name in (CONFIG_FILE, REPLAY_FILE) or self._told.get(name) == mark:
                continue
            files[name] = path.read_bytes()
            self._told[name] = mark
        return Report(self._status, files)
