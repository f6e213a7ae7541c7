"""Files that rollouts elsewhere need: they are sent by their contents, and lie in another place there."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from nathlon.policies.sources import SUFFIXES, suffix_of
from nathlon.sim.errors import InputError
from nathlon.sim.scratch import scratch_folder

if TYPE_CHECKING:
    from nathlon.policies.training.config import Opponent, TrainingConfig
    from nathlon.policies.training.pairs import Pair


class Parcel(NamedTuple):
    """A file, or a folder with the files in it.

    Attributes:
        name: path on the machine that sends it.
        files: contents by the place below the folder that holds what is sent.
    """

    name: str
    files: dict[str, bytes]


def needed(config: TrainingConfig, pairs: Sequence[Pair]) -> list[str]:
    """Paths of what travels: weights that drive in the rollouts, circuits and cars at paths."""
    weights: list[str] = []
    for opponents in (config.opponents, *(rollouts.opponents for rollouts in config.rollouts)):
        weights += [opponent.policy for opponent in opponents]
    for rollouts in config.rollouts:
        weights += rollouts.demonstrators
    found = [name for name in weights if suffix_of(name) in SUFFIXES]
    found += [name for pair in pairs for name in (pair.circuit, pair.car) if os.sep in name]
    return list(dict.fromkeys(found))


def pack(name: str) -> Parcel:
    """What lies at a path.

    Raises:
        InputError: if it cannot be read.
    """
    path = Path(name)
    try:
        files = [path] if path.is_file() else [each for each in path.iterdir() if each.is_file()]
        return Parcel(name, {str(file.relative_to(path.parent)): file.read_bytes() for file in sorted(files)})
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read: {error.strerror}, expected what the rollouts need"
        ) from None


class Arrived:
    """Files that have come, in a folder that goes with this object."""

    def __init__(self) -> None:
        self._folder = scratch_folder()
        self._places: dict[str, str] = {}

    def unpack(self, parcels: Iterable[Parcel]) -> None:
        """Put down what has come."""
        for parcel in parcels:
            folder = Path(self._folder.name) / str(len(self._places))
            for name, content in parcel.files.items():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).write_bytes(content)
            self._places[parcel.name] = str(folder / Path(parcel.name).name)

    def place(self, name: str) -> str:
        """Where something lies here; the name itself if it has not come."""
        return self._places.get(name, name)

    def config(self, config: TrainingConfig) -> TrainingConfig:
        """A configuration with what has come in its place here."""
        rollouts = tuple(
            each.model_copy(
                update={
                    "opponents": self._opponents(each.opponents),
                    "demonstrators": tuple(map(self.place, each.demonstrators)),
                }
            )
            for each in config.rollouts
        )
        return config.model_copy(
            update={"opponents": self._opponents(config.opponents), "rollouts": rollouts}
        )

    def pairs(self, pairs: Iterable[Pair]) -> list[Pair]:
        """Pairs with what has come in its place here."""
        return [pair._replace(circuit=self.place(pair.circuit), car=self.place(pair.car)) for pair in pairs]

    def _opponents(self, opponents: Iterable[Opponent]) -> tuple[Opponent, ...]:
        return tuple(each.model_copy(update={"policy": self.place(each.policy)}) for each in opponents)
