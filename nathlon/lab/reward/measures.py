"""What is measured of a clip, and the rule that makes one number of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from nathlon.lab.reward.clips import Clips
from nathlon.sim.expressions import Expression, Quantity, pure_number

MEASURES: Mapping[str, Quantity] = {
    "pace": Quantity("m/s", -10.0, 150.0, "centre line gained a second"),
    "pace_share": Quantity("1", -1.0, 10.0, "of what the built-in driver gains from the same start"),
    "off_course": Quantity("1", 0.0, 1.0, "share of the time with three tyres or more off the course"),
    "wall": Quantity("1", 0.0, 1.0, "share of the time at a wall"),
    "kerb": Quantity("1", 0.0, 4.0, "tyres on kerbs, on average"),
    "contacts": Quantity("1", 0.0, 100.0, "with cars, that began in the clip"),
    "contacts_at_fault": Quantity("1", 0.0, 100.0, "of these, those that the stewards find its fault"),
    "nearest": Quantity("m", 0.0, 500.0, "to the nearest car, between centres, when it was nearest"),
    "steering_rate": Quantity("rad/s", 0.0, 50.0, "change of the steering, mean of its magnitude"),
}
"""Of one clip of one car."""
RULE = "pace_share - 2 * off_course - wall - 0.25 * contacts - 0.25 * contacts_at_fault"
"""How clips are judged where nobody looks at them."""

Measured = dict[str, float]


def measure(clips: Clips, driver: Clips, step_s: float) -> list[Measured]:
    """MEASURES of each clip.

    Args:
        clips: what is measured.
        driver: the built-in driver's from the same starts.
        step_s: length of a step, s.
    """
    return [_measure(clips, driver, start, step_s) for start in range(len(clips.driven))]


def _measure(clips: Clips, driver: Clips, start: int, step_s: float) -> Measured:
    read = {name: values[start] for name, values in clips.readings.items()}
    length_s = step_s * clips.driven.shape[1]
    gained, its = read["progress"].sum(), driver.readings["progress"][start].sum()
    found = {
        "pace": gained / length_s,
        "pace_share": gained / max(its, 1.0),
        "off_course": read["off_course"].sum() / length_s,
        "wall": read["wall"].sum() / length_s,
        "kerb": read["kerb"].mean(),
        "contacts": read["contacts"].sum(),
        "contacts_at_fault": read["contacts_at_fault"].sum(),
        "nearest": read["nearest"].min(),
        "steering_rate": np.abs(read["steering_rate"]).mean(),
    }
    return {name: float(found[name]) for name in MEASURES}


def mean(measured: list[Measured]) -> Measured:
    """Means of some clips' measures."""
    return {name: float(np.mean([one[name] for one in measured])) for name in MEASURES}


def read_rule(text: str) -> Expression:
    """The rule that a text says, over MEASURES; a pure number, more is better.

    Raises:
        InputError: if it is none.
    """
    return pure_number(text, MEASURES)


def marks(rule: Expression, measured: Measured) -> float:
    """What a rule gives for a clip."""
    return float(rule({name: np.array(measured[name]) for name in rule.names}))
