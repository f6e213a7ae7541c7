"""Trainings of seconds, for the tests of commands that train, and of polishing."""

from __future__ import annotations

from nathlon.policies.training.config import TrainingConfig

TOML = """
circuit = "lindenring"
car = "gt3"
updates = 4
updates_per_step = 2
warm_up = 60
replay = 500
checkpoint_every = 2

[[rollouts]]
scenario = "1v0"
races = 3
learners = 1

[[rollouts]]
scenario = "standing_start"
races = 1
learners = 1
opponents = ["driver"]

[observation]
course_points = 3
cars_ahead = 1
cars_behind = 1

[qrsac]
hidden = [8]
quantiles = 4
batch = 16
n_step = 5

[reward]
passing = 0.5
"""
CHECKPOINTS = (2, 4)
"""Updates after which it leaves one."""


def polishing(*rollouts: dict, **more: object) -> TrainingConfig:
    """A configuration for polishing on the Lindenring, which has no use for what is common to it.

    Args:
        rollouts: scenarios and who drives in them.
        more: sections and fields.
    """
    unused = ("updates", "updates_per_step", "warm_up", "replay", "checkpoint_every")
    return TrainingConfig.model_validate(
        {"circuit": "lindenring", "car": "gt3", "rollouts": rollouts, **dict.fromkeys(unused, 1), **more}
    )
