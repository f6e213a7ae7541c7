"""An environment in another interpreter, which answers as a `ParallelEnv` does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from nathlon.arena.world import Space, WorldError
from nathlon.policies.child import Child, ChildError
from nathlon.policies.patience import WORLD_OPENS_S
from nathlon.sim import wire

if TYPE_CHECKING:
    from nathlon.sim.wire import Arrays

HOST = Path(__file__).with_name("host.py")


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

    def __init__(
        self, python: str, factory: str, folder: Path, packages: Sequence[str], answer_s: float
    ) -> None:
        """Start the process and have it make the environment.

        Args:
            python: the interpreter.
            factory: `MODULE:FUNCTION` or `PATH.py:FUNCTION`, a function without arguments.
            folder: from which paths start and modules are imported first.
            packages: whose versions decide how episodes go.
            answer_s: time that it has for a step.

        Raises:
            WorldError: if it cannot be made, or not in time.
        """
        place, colon, function = factory.rpartition(":")
        if place.endswith(".py"):
            factory = f"{(folder / place).absolute()}{colon}{function}"
        try:
            self._child = Child([python, str(HOST), "{pipe}", str(wire.__file__)])
        except OSError as error:
            raise WorldError(f"{python}: {error.strerror}, expected an interpreter of Python") from None
        wanted = {"factory": factory, "folder": str(folder.absolute()), "packages": list(packages)}
        told, arrays = self._ask(wanted, limit_s=max(WORLD_OPENS_S, answer_s))
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
        told, arrays = self._ask({"seed": seed}, limit_s=max(WORLD_OPENS_S, self._answer_s))
        return self._seen(told, arrays), self._by_name(told["infos"])

    def step(self, actions: Mapping[str, Any]) -> tuple[dict[str, Any], ...]:
        numbers = {str(self.possible_agents.index(seat)): np.asarray(done) for seat, done in actions.items()}
        told, arrays = self._ask({}, numbers, limit_s=self._answer_s)
        rest = (self._by_name(told[what]) for what in ("rewards", "terminations", "truncations", "infos"))
        return self._seen(told, arrays), *rest

    def render(self) -> NDArray[Any]:
        """As of `ParallelEnv`."""
        _, arrays = self._ask({"render": True}, limit_s=self._answer_s)
        return arrays["picture"]

    def close(self) -> None:
        """End the process."""
        self._child.end()

    def _ask(
        self, message: dict[str, Any], arrays: Arrays | None = None, *, limit_s: float
    ) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        try:
            told, brought = self._child.ask(message, arrays, limit_s=limit_s)
        except ChildError as error:
            raise WorldError(str(error)) from None
        if "raised" in told:
            self.close()
            raise WorldError(f"raised {told['raised']}")
        return told, brought

    def _seen(self, told: Mapping[str, Any], arrays: Arrays) -> dict[str, Any]:
        self.agents = [self.possible_agents[number] for number in told["agents"]]
        seen = self._by_name(arrays)
        return {
            seat: int(one) if isinstance(self.observation_space(seat), spaces.Discrete) else one
            for seat, one in seen.items()
        }

    def _by_name(self, values: Mapping[str, Any]) -> dict[str, Any]:
        return {self.possible_agents[int(number)]: value for number, value in values.items()}


def _space(told: Mapping[str, Any], arrays: Arrays) -> Space:
    match told["kind"]:
        case "Box":
            low, high, dtype = arrays[told["low"]], arrays[told["high"]], np.dtype(told["dtype"])
            return spaces.Box(low.astype(dtype), high.astype(dtype), dtype=dtype.type)
        case "Discrete":
            return spaces.Discrete(told["n"], start=told["start"])
    return spaces.MultiDiscrete(arrays[told["nvec"]], start=arrays[told["start"]])
