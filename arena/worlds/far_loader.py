"""A loader that runs in another interpreter, and the policies that it makes there."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.world import Space, WorldError
from nathlon.arena.worlds.foreign import Interpreter
from nathlon.policies.hosting.child import Child, ChildError, RaisedError
from nathlon.policies.memory_limit import memory_limit
from nathlon.policies.patience import FIRST_ANSWER_S, WORLD_OPENS_S
from nathlon.sim.errors import InputError


class FarError(Exception):
    """What a policy or its loader did there; a clause without its name."""


class EndedError(MemoryError):
    """The process there has ended while a policy was asked, for want of memory or by the policy's doing.

    Others have lost their memories with it: whoever runs matches does so again and blames who ended it.
    """


class FarLoader:
    """A loader in another interpreter, which has one process there for all that it makes."""

    def __init__(
        self,
        name: str,
        interpreter: Callable[[], Interpreter],
        factory: str,
        spaces: Callable[[], Sequence[tuple[Space, Space]]],
    ) -> None:
        """A loader that is not called yet.

        Args:
            name: `PATH.py:FUNCTION`.
            interpreter: where it runs; this and `spaces` are called when their world has been loaded.
            factory: of an environment, as of `Interpreter.started`: the loader gets its spaces.
            spaces: of all its seats, as they are here.

        Raises:
            ValueError: if the name is none.
        """
        place, _, self.__qualname__ = name.rpartition(":")
        if not place.endswith(".py"):
            raise ValueError(f"load is {name!r}, expected PATH.py:FUNCTION")
        self._name, self._interpreter, self._factory, self._spaces = name, interpreter, factory, spaces
        self._child: Child | None = None
        self._dropped: list[int] = []

    @property
    def file(self) -> Path:
        """In which it is.

        Raises:
            InputError: if there is none.
        """
        path = Path(self._interpreter().found(self._name).rpartition(":")[0])
        if not path.is_file():
            raise InputError(f"{path}: no such file, expected a loader")
        return path

    def __call__(self, path: Path, observed: Space, done: Space) -> FarPolicy:
        """The policy of a file for a seat that has these spaces.

        Raises:
            FarError: if the loader raises, gives no policy, or ends its process.
        """
        policy = FarPolicy(self, path, self._spaces().index((observed, done)))
        policy.load()
        return policy

    @property
    def running(self) -> Child:
        """Its process, which is started if there is none.

        Raises:
            FarError: if the loader is not to be had there.
        """
        if self._child is None or self._child.process.poll() is not None:
            interpreter = self._interpreter()
            try:
                self._child, _, _ = interpreter.started(
                    self._factory, WORLD_OPENS_S, loader=interpreter.found(self._name)
                )
            except WorldError as error:
                raise FarError(str(error)) from None
            self._dropped = []
        return self._child

    def ask(
        self, message: dict[str, Any], observation: NDArray[Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """What the process answers.

        Raises:
            FarError: if what was asked for raises there.
            ChildError: if the process does not answer as it should; it is ended then.
        """
        dropped, self._dropped = self._dropped, []
        arrays = {} if observation is None else {"observation": observation}
        # The watch over the process that asks has limits that are closer.
        try:
            return self.running.ask({**message, "dropped": dropped}, arrays, limit_s=FIRST_ANSWER_S)
        except RaisedError as error:
            raise FarError(f"raised {error}") from None

    def give_up(self, process: Child, number: int) -> None:
        """A policy of a process is not needed any more."""
        if process is self._child:
            self._dropped.append(number)


class FarPolicy:
    """A policy of another interpreter in one seat: called with an observation, after `reset`.

    Attributes:
        gives_scores: whether its numbers are scores of the choices.
    """

    gives_scores = False

    def __init__(self, loader: FarLoader, path: Path, seat: int) -> None:
        self._loader, self._path, self._seat = loader, path, seat

    def load(self) -> None:
        """Have the file read there.

        Raises:
            FarError: as of `FarLoader`.
        """
        self._process = self._loader.running
        try:
            with memory_limit(process=self._process.process.pid):
                told, _ = self._loader.ask({"path": str(self._path.absolute()), "seat": self._seat})
        except ChildError as error:
            raise FarError(str(error)) from None
        except (FileNotFoundError, ProcessLookupError):
            raise FarError("its process has ended") from None
        self._number, self.gives_scores = int(told["number"]), bool(told["gives_scores"])
        weakref.finalize(self, self._loader.give_up, self._process, self._number)

    def reset(self, seed: int) -> None:
        """Begin an episode; if the process has ended since, the file is read again."""
        if self._process is not self._loader.running:
            self.load()
        self._asked({"seed": seed})

    def __call__(self, observation: Any) -> NDArray[Any]:
        """Numbers (k,): an action, or scores."""
        return self._asked({}, np.asarray(observation))["action"]

    def _asked(self, message: dict[str, Any], seen: NDArray[Any] | None = None) -> dict[str, NDArray[Any]]:
        if self._process is not self._loader.running:
            raise EndedError(f"{self._path}: its process has ended")
        try:
            return self._loader.ask({**message, "number": self._number}, seen)[1]
        except ChildError as error:
            raise EndedError(f"{self._path}: {error}") from None
