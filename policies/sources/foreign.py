"""What is known of a policy that another program wrote: the card that its file may carry."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, model_validator

from nathlon.policies.checkpoint import Observation, Practises
from nathlon.policies.weights import Count, Names, Text, Versions
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec

MOST_FRAMES = 16
"""That may have been stacked."""

_POINT = ObservationSpec(course_points=2).size - ObservationSpec(course_points=1).size


class ForeignCard(BaseModel):
    """The fields of a checkpoint's card, `hidden` apart; None and empty for what is not known."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    format: Literal[1] = 1
    algorithm: Text | None = None
    observation: Observation | None = None
    practises: Practises = False
    circuit: Text | None = None
    car: Text | None = None
    scenarios: Names = ()
    step: Count | None = None
    transitions: Count | None = None
    seed: Count | None = None
    created_by: Versions = {}
    output: Text | None = None
    states: dict[Text, Text] = {}

    @model_validator(mode="after")
    def _has_what_to_practise(self) -> ForeignCard:
        if self.practises and not (self.observation and self.observation.planned):
            raise ValueError("practises is given, expected observations with a plan beside it")
        return self


def observation_spec(path: Path, policy_id: str, card: ForeignCard, size: int) -> ObservationSpec:
    """The observations of a policy that takes `size` numbers.

    A card that does not tell stands for the default with as many course points as fit.

    Raises:
        InputError: if the card's have a camera or another size, no number of course points fits, or a stack
            of frames with fewer fits as well.
    """
    if card.observation is not None:
        if card.observation.camera is not None:
            raise InputError(f"{path}: sees by a camera, expected a policy that is told numbers")
        expected = card.observation.size
        if expected != size:
            raise InputError(
                f"{path}: takes {size} numbers, expected {expected} as its card's observation has"
            )
        return card.observation.practising(policy_id) if card.practises else card.observation
    points = _points(size)
    if points is None:
        raise InputError(
            f"{path}: takes {size} numbers, expected {ObservationSpec().size}, the size of the default "
            "observation, or a card with another observation"
        )
    for frames in range(2, MOST_FRAMES + 1):
        of_a_frame = None if size % frames else _points(size // frames)
        if of_a_frame is not None:
            raise InputError(
                f"{path}: takes {size} numbers, which are {points} course points or {frames} stacked frames "
                f"of {of_a_frame}, expected a card that says its observation"
            )
    return ObservationSpec(course_points=points)


def _points(size: int) -> int | None:
    """Course points of the default observation if it has so many numbers."""
    more, rest = divmod(size - ObservationSpec(course_points=1).size, _POINT)
    return None if rest or not 0 <= more < 500 else more + 1
