"""What a design is made of."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from nathlon.lab.reward.measures import RULE, read_rule
from nathlon.policies.training.config import TrainingConfig
from nathlon.sim.data_file import Section
from nathlon.sim.errors import InputError

Updates = Annotated[int, Field(ge=1, le=10**9)]
POINTS = 5
"""Of the curve of a candidate's training."""


def _readable(text: str) -> str:
    try:
        return read_rule(text).text
    except InputError as error:
        raise ValueError(str(error)) from None


def _in_words(text: str) -> str:
    if not text.strip() or not text.isprintable():
        raise ValueError("expected words on one line")
    return text.strip()


class DesignSettings(Section):
    """A design.

    Attributes:
        task: what is wanted, in words.
        training: circuit, car, rollouts and networks of all trainings; its reward counts nothing.
        proposer: the embedded one, or a language model.
        judge: the rule, people in a browser, or a language model that sees pictures.
        rule: how clips are judged where the rule does, an expression of
            `nathlon.lab.reward.measures.MEASURES`.
        rounds: how often formulas are proposed.
        candidates: formulas of a round.
        kept: of these, those that are trained.
        updates, final_updates: of a candidate's training, and of the winner's last one.
        starts: clips of everybody.
        preferences: between clips of the library, before the first round.
        each: clips in which two candidates are compared, at most.
        seed: of all randomness.
    """

    task: Annotated[str, Field(max_length=2000), AfterValidator(_in_words)]
    training: TrainingConfig
    proposer: Literal["embedded", "model"] = "embedded"
    judge: Literal["rule", "people", "model"] = "rule"
    rule: Annotated[str, AfterValidator(_readable)] = RULE
    rounds: Annotated[int, Field(ge=1, le=100)] = 4
    candidates: Annotated[int, Field(ge=1, le=1000)] = 10
    kept: Annotated[int, Field(ge=1, le=100)] = 5
    updates: Updates = 8000
    final_updates: Updates = 40000
    starts: Annotated[int, Field(ge=1, le=64)] = 8
    preferences: Annotated[int, Field(ge=0, le=10_000)] = 100
    each: Annotated[int, Field(ge=1, le=64)] = 8
    seed: Annotated[int, Field(ge=0)] = 1

    @model_validator(mode="after")
    def _consistent(self) -> DesignSettings:
        if self.kept > self.candidates:
            raise ValueError(f"kept is {self.kept}, expected at most the {self.candidates} candidates")
        if self.training.variety is not None:
            raise ValueError("training has a variety of circuits, expected one circuit and one car")
        return self

    def run(self, expression: str, updates: int) -> TrainingConfig:
        """The training of a formula, with checkpoints for a curve; of at least so many updates."""
        points = min(POINTS, updates)
        every = -(-updates // points)
        reward = type(self.training.reward)(expression=expression)
        return self.training.model_copy(
            update={"updates": every * points, "checkpoint_every": every, "reward": reward}
        )
