"""An environment in another interpreter, which answers as a `ParallelEnv` does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from nathlon.arena.world import Space, WorldError
from nathlon.policies.hosting import wire
from nathlon.policies.hosting.child import Child, ChildError, RaisedError
from nathlon.policies.patience import WORLD_OPENS_S

if TYPE_CHECKING:
    from nathlon.policies.hosting.wire import Arrays

HOST = Path(__file__).with_name("host.py")


@dataclass(frozen=True)
class Interpreter:
    """Another interpreter of Python.

    Attributes:
        python: its path.
        folder: from which paths start and modules are imported first.
        packages: whose versions decide how episodes go.
    """

    python: str
    folder: Path
    packages: Sequence[str]

    def started(
        self, factory: str, limit_s: float, **more: str
    ) -> tuple[Child, dict[str, Any], dict[str, NDArray[Any]]]:
        """A process of it, see `nathlon.arena.worlds.host`, and what it answers at first.

        Args:
            factory: of an environment, `MODULE:FUNCTION` or `PATH.py:FUNCTION`, a function without arguments.
            limit_s: time that it has.
            more: what else it is asked for.

        Raises:
            WorldError: if it cannot be started, or not in time.
        """
        try:
            child = Child([self.python, str(HOST), "{pipe}", str(wire.__file__)])
        except OSError as error:
            raise WorldError(f"{self.python}: {error.strerror}, expected an interpreter of Python") from None
        folder, packages = str(self.folder.absolute()), list(self.packages)
        wanted = {"factory": self.found(factory), "folder": folder, "packages": packages, **more}
        return child, *_asked(child, wanted, None, limit_s)

    def found(self, function: str) -> str:
        """A function by the absolute path of its file, if it goes by a path."""
        place, colon, name = function.rpartition(":")
        return f"{(self.folder / place).absolute()}{colon}{name}" if place.endswith(".py") else function


class Foreign:
    """An environment in a process of another interpreter; see `nathlon.arena.worlds.host`.

    The process ends with this object, with this process, or when it fails.

    Attributes:
        possible_agents: names of all seats.
        agents: of those that still play.
        render_mode: whether it draws, and how.
        in_turn: whether one seat plays at a time, and others hear of rewards meanwhile.
        identity: hash of the file that makes it, and versions of Python, numpy and the named packages.
    """

    def __init__(self, interpreter: Interpreter, factory: str, answer_s: float) -> None:
        """Start the process and have it make the environment.

        Args:
            interpreter: whose process it is.
            factory: as of `Interpreter.host`.
            answer_s: time that it has for a step.

        Raises:
            WorldError: if it cannot be made, or not in time.
        """
        self._child, told, arrays = interpreter.started(factory, max(WORLD_OPENS_S, answer_s))
        self._answer_s = answer_s
        self._spaces = {
            str(seat): (_space(seen, arrays), _space(done, arrays)) for seat, seen, done in told["seats"]
        }
        self.possible_agents = tuple(self._spaces)
        self.agents: list[str] = []
        self.render_mode, self.in_turn = told["render_mode"], told["in_turn"]
        self.identity = {"files": dict(told["files"]), "packages": dict(told["versions"])}

    def observation_space(self, seat: str) -> Space:
        """As of `ParallelEnv`."""
        return self._spaces[seat][0]

    def action_space(self, seat: str) -> Space:
        """As of `ParallelEnv`."""
        return self._spaces[seat][1]

    def reset(self, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
        """As of `ParallelEnv`; so is the following."""
        told, arrays = _asked(self._child, {"seed": seed}, None, max(WORLD_OPENS_S, self._answer_s))
        return self._seen(told, arrays), self._by_name(told["infos"])

    def step(self, actions: Mapping[str, Any]) -> tuple[dict[str, Any], ...]:
        numbers = {str(self.possible_agents.index(seat)): np.asarray(done) for seat, done in actions.items()}
        told, arrays = _asked(self._child, {}, numbers, self._answer_s)
        rest = (self._by_name(told[what]) for what in ("rewards", "terminations", "truncations", "infos"))
        return self._seen(told, arrays), *rest

    def render(self) -> NDArray[Any]:
        """As of `ParallelEnv`."""
        _, arrays = _asked(self._child, {"render": True}, None, self._answer_s)
        return arrays["picture"]

    def close(self) -> None:
        """End the process."""
        self._child.end()

    def _seen(self, told: Mapping[str, Any], arrays: Arrays) -> dict[str, Any]:
        self.agents = [self.possible_agents[number] for number in told["agents"]]
        seen = self._by_name(arrays)
        return {
            seat: int(one) if isinstance(self.observation_space(seat), spaces.Discrete) else one
            for seat, one in seen.items()
        }

    def _by_name(self, values: Mapping[str, Any]) -> dict[str, Any]:
        return {self.possible_agents[int(number)]: value for number, value in values.items()}


def _asked(
    child: Child, message: dict[str, Any], arrays: Arrays | None, limit_s: float
) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """What a process answers.

    Raises:
        WorldError: if it does not, or what is asked for raises there; it is ended then.
    """
    try:
        return child.ask(message, arrays, limit_s=limit_s)
    except ChildError as error:
        raise WorldError(str(error)) from None
    except RaisedError as error:
        child.end()
        raise WorldError(f"raised {error}") from None


def _space(told: Mapping[str, Any], arrays: Arrays) -> Space:
    match told["kind"]:
        case "Box":
            low, high, dtype = arrays[told["low"]], arrays[told["high"]], np.dtype(told["dtype"])
            return spaces.Box(low.astype(dtype), high.astype(dtype), dtype=dtype.type)
        case "Discrete":
            return spaces.Discrete(told["n"], start=told["start"])
    return spaces.MultiDiscrete(arrays[told["nvec"]], start=arrays[told["start"]])
