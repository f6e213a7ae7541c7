"""Designs of seconds for the tests: clips made of numbers, or driven once; trainings of one update."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.lab.reward.clips import Clips, Studio
from nathlon.lab.reward.library import DRIVER, STILL, Parked, drivers
from nathlon.lab.reward.settings import DesignSettings
from nathlon.policies.load import load_policy
from nathlon.policies.training.config import TrainingConfig
from nathlon.sim.instruments import QUANTITIES
from tests.support.trainings import TOML

TASK = "drive fast, leave room, stay on the road"
STARTS = 2
STEPS = 40


def made_up(name: str, starts: int = STARTS, **readings: float | NDArray[np.float64]) -> Clips:
    """Clips whose readings are 0 but for those given, for all steps or (starts, steps)."""
    shape = (starts, STEPS)
    zeros = {quantity: np.zeros(shape) for quantity in QUANTITIES}
    given = {
        quantity: np.broadcast_to(np.asarray(value, float), shape) for quantity, value in readings.items()
    }
    return Clips(name, zeros | given, np.ones(shape, np.bool_), np.zeros((starts, STEPS + 1, 4, 3)), [])


def made_up_library() -> dict[str, Clips]:
    """Who drives on, who stands, who leaves the course at times, and who touches others."""
    gone = np.zeros((STARTS, STEPS))
    gone[:, ::4] = 0.1
    return {
        DRIVER: made_up(DRIVER, progress=4.5, speed=45.0, speed_before=45.0, nearest=20.0),
        STILL: made_up(STILL, nearest=500.0),
        "wild": made_up("wild", progress=4.8, speed=48.0, speed_before=48.0, off_course=gone, nearest=20.0),
        "rude": made_up("rude", progress=4.6, speed=46.0, speed_before=46.0, contacts=0.1, nearest=4.0),
    }


def filmed(folder: Path) -> None:
    """Fill the folder of a library with clips that were really driven, of three drivers under all names."""
    studio = Studio("lindenring", "gt3", STARTS)
    driver = load_policy(DRIVER, "lindenring", "gt3")
    slow = load_policy("driver:pace=0.7", "lindenring", "gt3")
    takes = [studio.film(policy, "")[0] for policy in (driver, slow, Parked(driver.observation_spec))]
    for number, name in enumerate(drivers("lindenring", "gt3", np.random.default_rng(0))):
        take = takes[0] if name == DRIVER else takes[2] if name == STILL else takes[1]
        Clips(name, take.readings, take.driven, take.poses, take.drawn).save(folder / f"{number:02d}")


def settings(**other: Any) -> DesignSettings:
    """A design of trainings of one update."""
    facts: dict[str, Any] = {
        "task": TASK,
        "training": TrainingConfig.model_validate(tomllib.loads(TOML)),
        "rounds": 2,
        "candidates": 3,
        "kept": 1,
        "updates": 1,
        "final_updates": 1,
        "starts": STARTS,
        "preferences": 10,
        "each": 2,
    }
    return DesignSettings(**(facts | other))
