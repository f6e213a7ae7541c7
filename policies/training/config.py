"""What a training run is made of, as a TOML file says it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from policies.qrsac.config import QRSACConfig
from policies.training.rewards import RewardWeights
from sim.data_file import Section, read_toml
from sim.observation import ObservationSpec

Count = Annotated[int, Field(ge=1)]

CONFIGS = Path(__file__).parent / "configs"
"""The configurations that come with nathlon."""


class Rollouts(Section):
    """Races of one scenario that run side by side."""

    scenario: str
    races: Count
    learners: Count  # cars a race that the learner drives and learns from
    opponents: tuple[str, ...] = ()  # who drives the others, in turn; see policies.load


class ObservationSettings(Section):
    """The observation spec to train on; see sim.observation."""

    course_points: Count = 60
    horizon_s: float = 6.0
    cars_ahead: Annotated[int, Field(ge=0)] = 4
    cars_behind: Annotated[int, Field(ge=0)] = 4

    def spec(self) -> ObservationSpec:
        """The spec itself."""
        return ObservationSpec(**self.model_dump())


class TrainingConfig(Section):
    """A training run.

    Attributes:
        updates: gradient updates of the whole run.
        updates_per_step: updates after each step of all rollouts.
        warm_up: transitions to gather before the first update.
        replay: transitions to remember.
        checkpoint_every: updates between checkpoints.
    """

    circuit: str
    car: str
    updates: Count
    updates_per_step: Count
    warm_up: Count
    replay: Count
    checkpoint_every: Count
    rollouts: Annotated[tuple[Rollouts, ...], Field(min_length=1)]
    observation: ObservationSettings = ObservationSettings()
    qrsac: QRSACConfig = QRSACConfig()
    reward: RewardWeights = RewardWeights()

    @model_validator(mode="after")
    def _warm_up_fits(self) -> TrainingConfig:
        if self.warm_up > self.replay:
            raise ValueError("warm_up must not be larger than replay")
        return self


def read_config(path: Path) -> TrainingConfig:
    """Read and check a training configuration.

    Raises:
        InputError: if the file cannot be read, or a field is missing, unknown or out of range.
    """
    return read_toml(path, TrainingConfig, "training configuration")
