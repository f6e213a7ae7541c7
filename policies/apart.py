"""Policies that are code, in processes of their own: one that hangs, exits or prints harms nobody."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.hosting.child import Child, ChildError, LateError, RaisedError
from nathlon.policies.load import load_policy
from nathlon.policies.patience import ANSWER_S, FIRST_ANSWER_S, TimedOutError
from nathlon.policies.policy import Batch, Observations, Policy
from nathlon.policies.sources import COMPOSITE, PLUGIN, suffix_of
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.process import command_of

if TYPE_CHECKING:
    from nathlon.policies.hosting.wire import Arrays


def is_guest(name: str) -> bool:
    """Whether the policy called `name` may hang or crash, as plugins, composites and ONNX graphs may.

    Weights and built-in drivers can do no harm.
    """
    return name.partition(":")[0] == PLUGIN or suffix_of(name) in (COMPOSITE, ".onnx")


def load_guest(name: str, circuit: str, car: str) -> Policy:
    """The policy called `name` for a program that must outlive it; see `nathlon.policies.load.load_policy`.

    Guests run in processes of their own, and raise an InputError when they do not answer as they should; all
    others run in this one.

    Raises:
        InputError: if there is no such policy or it cannot be read.
    """
    return PolicyApart(name, circuit, car) if is_guest(name) else load_policy(name, circuit, car)


class PolicyApart:
    """A policy in a process of its own, which ends with this object or with this process.

    What it prints goes to this process's stderr.

    Attributes:
        process: the process.
        failure: why it is asked no more, in a clause without its name; '' while it answers as it should.
        reverse: whether its cars have a reverse gear.
    """

    observation_spec: ObservationSpec

    def __init__(
        self,
        source: str,
        circuit: str,
        car: str,
        answer_s: float = ANSWER_S,
        first_answer_s: float = FIRST_ANSWER_S,
    ) -> None:
        """Open a policy.

        Args:
            source, circuit, car: as of `load_policy`.
            answer_s: time that it has for an answer.
            first_answer_s: time that it has to open, and for its first answer.

        Raises:
            InputError: if it cannot be opened, or not in time.
        """
        self._source, self._answer_s, self._limit_s = source, answer_s, first_answer_s
        self.failure = ""
        self._child = Child(command_of("nathlon.policies.apart_host", "{pipe}"))
        self.process = self._child.process
        opened, _ = self._ask({"source": source, "circuit": circuit, "car": car, "path": sys.path})
        try:
            self.observation_spec = ObservationSpec.from_dict(opened["observation_spec"])
            self.reverse = bool(opened["reverse"])
        except (KeyError, TypeError):
            raise self._refused("answers without its observations, expected a policy") from None
        self._limit_s = first_answer_s

    def warm_up(self, seed: int) -> None:
        """Have its first answer behind it, which may take long; it goes on as if it had just been opened.

        Args:
            seed: of the random generators that it finds then, as of `nathlon.policies.isolation.Apart`.

        Raises:
            InputError: as of `act`.
        """
        self.act(self.observation_spec.blank(1), self.initial_memory(1))
        self._ask({"seed": seed})

    def close(self) -> None:
        """End its process."""
        self._child.end()

    def initial_memory(self, n: int) -> Batch:
        """As of `nathlon.policies.policy.Policy`."""
        return self._rows("memory", self._ask({"cars": n})[1], n)

    def act(self, observations: Observations, memory: Batch) -> tuple[Batch, Batch]:
        """As of `nathlon.policies.policy.Policy`.

        Raises:
            InputError: if it raises, does not answer in time, or answers with something else.
        """
        # Records travel in parts: messages hold arrays of numbers alone.
        names = observations.dtype.names
        seen = (
            {"observations": observations} if names is None else {name: observations[name] for name in names}
        )
        _, arrays = self._ask({}, {**seen, "memory": memory})
        self._limit_s = self._answer_s
        actions = self._rows("actions", arrays, len(observations))
        if actions.shape != (len(observations), 2) or not np.isfinite(actions).all():
            raise self._refused(
                f"answers with {actions.shape}, expected ({len(observations)}, 2) finite numbers"
            )
        return actions, self._rows("memory", arrays, len(observations))

    def _rows(self, name: str, arrays: Arrays, n: int) -> Batch:
        array = arrays.get(name, np.zeros(0))
        if array.ndim != 2 or len(array) != n:
            raise self._refused(f"has {name} of shape {array.shape}, expected {n} rows")
        return array.astype(np.float32)

    def _refused(self, reason: str) -> InputError:
        self.failure = reason
        self._child.end()
        return InputError(f"{self._source}: {reason}")

    def _ask(
        self, message: dict[str, Any], arrays: Arrays | None = None
    ) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        try:
            answer, brought = self._child.ask(message, arrays, limit_s=self._limit_s)
        except LateError as error:
            self.failure = str(error)
            raise TimedOutError(f"{self._source}: {error}") from None
        except ChildError as error:
            raise self._refused(str(error)) from None
        except RaisedError as error:
            raise self._refused(f"raised {error}, expected actions") from None
        if "refused" in answer:
            self._child.end()
            raise InputError(str(answer["refused"]))
        return answer, brought
