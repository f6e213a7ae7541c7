"""Policies that a world's own code makes of files: shown observations as they are, answering with actions.

A file of weights alone does not say what its numbers mean. Whoever has trained it has the few lines that do:
a world's mapping names them, and they run in the processes in which matches do.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from nathlon.arena.world import Loader, Space
from nathlon.arena.worlds.far_loader import EndedError, FarError, FarPolicy
from nathlon.policies.checkpoint import checkpoint_id
from nathlon.policies.general.outputs import IllegalActionError, Outputs
from nathlon.policies.sources import WEIGHTS
from nathlon.sim.errors import InputError

_FLAT = (spaces.Box, spaces.Discrete, spaces.MultiDiscrete)
"""Action spaces whose actions are rows of numbers."""


Named = Loader | str
"""A loader, or the name of one in another interpreter."""


def by_ending(
    load: Named | Mapping[str, Named] | None, by_name: Callable[[str], Loader] | None = None
) -> dict[str, Loader]:
    """Loaders by the endings of files, in small letters; one without any is for those of `WEIGHTS`.

    Args:
        load: one loader, or several by endings.
        by_name: gives the loader of a name; None where there are no names.

    Raises:
        ValueError: if an ending is none, or what stands for it cannot be called.
    """
    found: dict[str, Any] = (
        dict(load) if isinstance(load, Mapping) else dict.fromkeys(WEIGHTS, load) if load else {}
    )
    named = {one: by_name(one) for one in found.values() if by_name and isinstance(one, str)}
    found = {ending: named.get(one, one) for ending, one in found.items()}
    for ending, loader in found.items():
        if not isinstance(ending, str) or not ending or not callable(loader):
            raise ValueError(f"load has {ending!r}: {loader!r}, expected an ending of files and a function")
    return {ending.lower(): loader for ending, loader in found.items()}


def loader_of(loaders: Mapping[str, Loader], source: str) -> Loader | None:
    """The loader for a file, by the longest ending that its name has; None where there is none."""
    name = Path(source).name.lower()
    endings = [ending for ending in loaders if name.endswith(ending)]
    return loaders[max(endings, key=len)] if endings else None


@dataclass(frozen=True)
class LoadedPolicy:
    """A policy of a file that a loader has read.

    Attributes:
        source: path of the file.
        id: SHA-256 of its bytes.
        load: the loader.
        observed, done: spaces that it was made for.
        algorithm, step, seed: of its training, which nobody tells.
    """

    source: str
    id: str
    load: Loader
    observed: Space
    done: Space
    algorithm: str | None = None
    step: int | None = None
    seed: int | None = None
    _made: list[Any] = field(default_factory=list)

    @classmethod
    def of(cls, source: str, load: Loader, observed: Space, done: Space) -> LoadedPolicy:
        """The policy of a file, for which the loader has not been called yet.

        Raises:
            InputError: if there is no such file.
        """
        return cls(source, checkpoint_id(Path(source)), load, observed, done)

    @classmethod
    def read(cls, source: str, load: Loader, observed: Space, done: Space) -> LoadedPolicy:
        """The policy of a file, tried on an observation where the space is a Box.

        Raises:
            InputError: if there is no such file, or what the loader gives cannot act.
        """
        policy = cls.of(source, load, observed, done)
        with_state = policy.of_seat(0)
        if isinstance(observed, spaces.Box):
            own = deepcopy(observed)
            own.seed(0)
            try:
                with_state.reset(0)
                with_state.act(own.sample(), done, np.random.default_rng(0))
            except EndedError as error:
                raise InputError(str(error)) from None
            except MemoryError:
                raise
            # It is the user's own code: whatever it raises, they want to know where.
            except (Exception, SystemExit) as error:
                raise InputError(f"{source}: shown an observation, {_said(error)}") from error
        return policy

    def check(self, observed: Space, done: Space) -> None:
        """Raise an InputError for other spaces than it was made for."""
        for what, own, other in (("observation", self.observed, observed), ("action", self.done, done)):
            if own != other:
                raise InputError(f"{self.source}: was made for the {what} space {own}, expected {other}")

    def of_seat(self, number: int) -> Seated:
        """It in one of the seats that it takes in an episode; what keeps state is loaded for each of them.

        Raises:
            InputError: if what the loader gives is no policy.
        """
        if not self._made:
            self._made.append(self.make())
        if not _keeps_state(self._made[0]):
            return Seated(self.source, self._made[0])
        while len(self._made) <= number:
            self._made.append(self.make())
        return Seated(self.source, self._made[number])

    def make(self) -> Any:
        """What the loader gives: called with an observation, or with `act(observation, memory)`.

        Raises:
            InputError: if it is neither.
        """
        called = getattr(self.load, "__qualname__", repr(self.load))
        try:
            made = self.load(Path(self.source), self.observed, self.done)
        except (MemoryError, InputError):
            raise
        except (Exception, SystemExit) as error:
            raise InputError(f"{self.source}: {called} {_said(error)}, expected a policy") from error
        if not callable(getattr(made, "act", made)):
            raise InputError(
                f"{self.source}: {called} gives {type(made).__name__}, "
                "expected what is called with an observation, or has act(observation, memory)"
            )
        return made


class Seated:
    """A loaded policy in a seat, with the memory of an episode.

    Attributes:
        memory: after its last step; None before the first.
    """

    def __init__(self, source: str, made: Any) -> None:
        """Of what a loader has made."""
        self._source, self._made = source, made
        self.memory: Any = None
        torch: Any = sys.modules.get("torch")
        self._torch = torch if torch and isinstance(made, torch.nn.Module) else None
        if self._torch:
            made.eval()

    def reset(self, seed: int) -> None:
        """Begin an episode."""
        self.memory = None
        if _keeps_state(self._made):
            self._made.reset(seed)

    def act(self, observation: Any, done: Space, rng: np.random.Generator) -> Any:
        """An action of a space, having seen an observation, which it may change.

        Raises:
            IllegalActionError: if it answers with no action.
        """
        if self._remembers:
            answer = self._made.act(observation, self.memory)
            if not isinstance(answer, tuple) or len(answer) != 2:
                raise IllegalActionError(f"act gives {type(answer).__name__}, expected action and memory")
            answer, self.memory = answer
        elif self._torch:
            answer = self._scores(_batch(self._torch, observation))
        else:
            answer = self._made(observation)
        if not isinstance(done, _FLAT):
            return answer
        return self._action(_row(answer), done, rng)

    @property
    def batches(self) -> bool:
        """Whether it is a module without memory, which may be asked for many seats at once."""
        return bool(self._torch) and not self._remembers

    def act_together(self, observations: Any, done: Space, rng: np.random.Generator) -> NDArray[Any]:
        """Actions (n, ...) of a space for observations (n, ...), or for a dictionary of them.

        Raises:
            IllegalActionError: if it answers with no actions.
        """
        answer = self._scores(_tensors(self._torch, observations)).detach().cpu().numpy()
        n = len(next(iter(observations.values())) if isinstance(observations, dict) else observations)
        if answer.ndim < 1 or len(answer) != n:
            raise IllegalActionError(f"the module gives {answer.shape} for {n} observations")
        return np.stack([self._action(_row(row), done, rng) for row in answer])

    @property
    def _remembers(self) -> bool:
        return hasattr(self._made, "act")

    def _action(self, row: NDArray[Any], done: Space, rng: np.random.Generator) -> Any:
        scores = self.batches or (isinstance(self._made, FarPolicy) and self._made.gives_scores)
        outputs = Outputs("clip", "argmax" if scores else "choice")
        try:
            return outputs.decode(self._source, row, done, rng)
        except InputError as error:
            raise IllegalActionError(str(error)) from None

    def _scores(self, batch: Any) -> Any:
        """What a module answers to a batch of observations."""
        assert self._torch is not None
        with self._torch.no_grad():
            answer = self._made(batch)
        if not isinstance(answer, self._torch.Tensor):
            raise IllegalActionError(
                f"the module gives {type(answer).__name__}, expected one tensor: "
                "have the loader give a function that picks the action"
            )
        return answer


def _keeps_state(made: Any) -> bool:
    return callable(getattr(made, "reset", None))


def _batch(torch: Any, observation: Any) -> Any:
    """An observation as a batch of one."""
    if isinstance(observation, Mapping):
        return {name: _batch(torch, one) for name, one in observation.items()}
    if isinstance(observation, tuple):
        return tuple(_batch(torch, one) for one in observation)
    return _tensors(torch, np.asarray(observation)[None])


def _tensors(torch: Any, observations: Any) -> Any:
    """Arrays of a batch as tensors."""
    if isinstance(observations, Mapping):
        return {name: _tensors(torch, one) for name, one in observations.items()}
    kept = observations.astype(np.float32) if observations.dtype.kind == "f" else observations
    return torch.as_tensor(kept)


def _row(answer: Any) -> NDArray[Any]:
    """Numbers (k,) of an answer of any library."""
    if hasattr(answer, "detach"):
        answer = answer.detach().cpu()
    try:
        row = np.asarray(answer).ravel()
    except ValueError as error:  # of rows of several lengths
        raise IllegalActionError(f"gives no array of numbers: {error}") from None
    if row.dtype.kind not in "biuf":
        raise IllegalActionError(f"gives {row.dtype}, expected numbers")
    return row


def _said(error: BaseException) -> str:
    if isinstance(error, IllegalActionError | FarError):
        return str(error)
    return f"raised {type(error).__name__} ({error})"
