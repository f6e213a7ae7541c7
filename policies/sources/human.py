"""What a person did at the wheel, kept so that it can be driven again: `human:FILE`."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from nathlon.policies.policy import Batch
from nathlon.policies.policy_file import content_id
from nathlon.sim.data_file import Name
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.untrusted_file import read_bytes
from nathlon.sim.validation import first_fault
from nathlon.sim.whole_file import whole_file

MOST_MIB = 16
"""Of a file: the longest race there is takes 14."""
Hands = Callable[[int], tuple[float, float]]
"""Throttle (+) or brake (-) and steering (+ is left), each in [-1, 1], in a dynamics step of a race."""


class InputsFile(BaseModel):
    """A file of inputs.

    Attributes:
        format: version of the format.
        name: of the person.
        circuit, car: that they drove.
        controls: little-endian float32 in base64, throttle or brake and steering of each step in turn.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    format: Literal[1] = 1
    name: Name
    circuit: Name
    car: Name
    controls: str


class Person:
    """A person at the wheel as a policy, which acts in every dynamics step.

    Its memory is how many steps it has driven. What it sees, it does not use: the person looks at a screen.

    Args:
        hands: what they do, asked once for each step in turn.
        name: of the person.
        identity: SHA-256 of the file of inputs; empty while they are still driving.
    """

    def __init__(self, hands: Hands, name: str, identity: str = "") -> None:
        self.observation_spec = ObservationSpec()
        self.reverse = True
        self.name = name
        self.id = identity
        self._hands = hands

    def initial_memory(self, n: int) -> Batch:
        """See `Policy.initial_memory`."""
        return np.zeros((n, 1), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        """See `Policy.act`."""
        return np.array([self._hands(int(step)) for step in memory[:, 0]], np.float32), memory + 1.0


def write_inputs(path: Path, name: str, circuit: str, car: str, controls: NDArray[np.float32]) -> None:
    """Write what a person did, whole or not at all.

    Args:
        path: the file.
        name: of the person.
        circuit, car: that they drove.
        controls: (steps, 2), throttle or brake and steering.
    """
    packed = base64.b64encode(np.ascontiguousarray(controls, "<f4").tobytes()).decode()
    inputs = InputsFile(name=name, circuit=circuit, car=car, controls=packed)
    with whole_file(path) as partial:
        partial.write_text(inputs.model_dump_json(indent=1) + "\n", "utf-8")


def load_person(path: Path, circuit: str, car: str) -> Person:
    """The person whose inputs a file holds, to drive the same again; after its end they let everything go.

    Raises:
        InputError: if it cannot be read, or was driven elsewhere.
    """
    content = read_bytes(path, MOST_MIB, "inputs of a person")
    try:
        inputs = InputsFile.model_validate_json(content)
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error, InputsFile)}") from None
    for field, driven, wanted in (("circuit", inputs.circuit, circuit), ("car", inputs.car, car)):
        if driven != wanted:
            raise InputError(f"{path}: {field} is {driven!r}, expected {wanted!r}")
    steps = [(float(pedals), float(steering)) for pedals, steering in _controls(path, inputs.controls)]

    def hands(step: int) -> tuple[float, float]:
        return steps[step] if step < len(steps) else (0.0, 0.0)

    return Person(hands, inputs.name, content_id(content))


def _controls(path: Path, packed: str) -> NDArray[np.float32]:
    try:
        controls = np.frombuffer(base64.b64decode(packed, validate=True), "<f4").reshape(-1, 2)
    except (binascii.Error, ValueError):
        controls = np.full((1, 2), np.nan, np.float32)
    if not (np.abs(controls) <= 1.0).all():
        raise InputError(f"{path}: field controls: expected pairs of float32 from -1 to 1 in base64")
    return controls
