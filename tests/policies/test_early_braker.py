"""The early braker: the same lap as its driver, with the brakes on sooner."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.policies.load import load_policy
from nathlon.policies.policy import Policy
from nathlon.sim.car import load_car
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track import load_track

TRACK = load_track("lindenring")


def lap(policy: Policy) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Progress, pedal and off course flag at each step of a flying lap."""
    scenario = load_scenario("time_trial")
    world = scenario.world(TRACK, load_car("gt3"), 1)
    world.reset(0, scenario.place(TRACK, np.random.default_rng(0)))
    zero, memory, seen = np.zeros(1, np.int64), policy.initial_memory(1), []
    while world.state["driving"].all() and world.time[0] < 200.0:
        action, memory = policy.act(world.observe(policy.observation_spec, zero, zero), memory)
        car = world.state[0, 0]
        seen.append((float(car["progress"]), float(action[0, 0]), bool(car["off_course"])))
        world.step(action[None])
    progress, pedal, off = (np.array(column) for column in zip(*seen, strict=True))
    return progress, pedal, off


def test_it_brakes_earlier_for_the_hairpin_and_stays_on_the_road() -> None:
    onsets, steps = [], []
    for name in ("driver:pace=0.95", "driver:pace=0.95,early=30"):
        progress, pedal, off = lap(load_policy(name, "lindenring", "gt3"))
        assert not off.any()
        straight = (progress > 2000.0) & (progress < 2400.0)
        onsets.append(progress[straight & (pedal < -0.3)][0])
        steps.append(len(progress))
    assert 20.0 < onsets[0] - onsets[1] < 45.0
    assert 0 < steps[1] - steps[0] < 0.12 * steps[0]


def test_settings_are_checked() -> None:
    with pytest.raises(InputError, match=r"early is -1\.0, expected 0 to 200 m"):
        load_policy("driver:early=-1", "lindenring", "gt3")
    with pytest.raises(InputError, match="unknown setting 'late', expected one of pace, lane, early"):
        load_policy("driver:late=1", "lindenring", "gt3")
