"""A recorded race is the race that was run."""

from __future__ import annotations

import numpy as np
import pytest

from arena.race_log import RaceLog
from arena.recorder import record_race
from arena.runner import run_match
from policies.driver import Driver
from policies.policy import Policy
from tests.test_runner import DRIVER, SLOW, sprint

MATCH = sprint(DRIVER, SLOW, seats=(1, 0), races=2)


@pytest.fixture(scope="module")
def policies() -> list[Policy]:
    return [Driver("lindenring", "gt3"), Driver("lindenring", "gt3", pace=0.85)]


@pytest.fixture(scope="module")
def log(policies: list[Policy]) -> RaceLog:
    return record_race(MATCH, policies, 1, ["quick", "slow"])


def test_it_holds_the_race_from_start_to_the_last_ending(log: RaceLog, policies: list[Policy]) -> None:
    results = run_match(MATCH, policies)
    results = results.filter(results["race"] == 1).sort("car")
    assert log.names == ("slow", "quick")
    assert log.samples.shape == (len(log.time_s), 2)
    assert np.allclose(np.diff(log.time_s), 0.1)
    assert log.time_s[0] == 0.0
    assert log.time_s[-1] == pytest.approx(results["driven_s"].max(), abs=0.1)
    assert log.samples["place"][-1].tolist() == results["place"].to_list()
    assert np.allclose(log.samples["distance_m"][-1], results["distance_m"].to_numpy())
    endings = [incident for incident in log.incidents if incident.kind == "ending"]
    assert {incident.cars[0] for incident in endings} == {0, 1}


def test_positions_agree_with_velocities(log: RaceLog) -> None:
    """Distances between samples are what the speeds integrate to (trapezoid, to 2 cm)."""
    car = log.samples[:-1, 1]
    car = car[car["driving"]]
    moved = np.hypot(np.diff(car["x_m"]), np.diff(car["y_m"]))
    speed = np.hypot(car["velocity_x_m_s"], car["velocity_y_m_s"]).astype(float)
    assert np.abs(moved - 0.05 * (speed[1:] + speed[:-1])).max() < 0.02 + 0.01 * speed.max()


def test_cars_lie_within_the_outline(log: RaceLog) -> None:
    half = np.hypot(*(log.outline.wall_left - log.outline.wall_right).T).max() / 2
    for x, y in zip(log.samples["x_m"].ravel()[::50], log.samples["y_m"].ravel()[::50], strict=True):
        assert np.hypot(*(log.outline.centre - [x, y]).T).min() < half
