"""Reward components against hand-made transitions."""

from __future__ import annotations

import numpy as np
import pytest

from policies.training.rewards import RewardWeights, Transition, total
from sim.world import World
from tests.driving import stadium, world_with

DT = 0.1


@pytest.fixture
def world() -> World:
    """Two cars on a straight, the second 18 m behind and 5 m/s faster."""
    return world_with(stadium(), [1300.0, 1282.0], lateral=[2.0, -2.0], speed=[40.0, 45.0])


def test_progress_is_metres_gained_and_masked_off_course(world: World) -> None:
    transition = Transition(world)
    world.step(np.zeros((1, 2, 2)))
    gained = transition.progress()[0]
    assert gained == pytest.approx([4.0, 4.5], abs=0.1)
    world.state["off_course"][0, 0] = True
    assert transition.progress()[0].tolist() == [0.0, gained[1]]


def test_off_course_and_wall_are_charged_on_the_speed_before_the_step(world: World) -> None:
    transition = Transition(world)
    world.state["off_course_s"][0, 0] += DT
    world.state["wall_s"][0, 1] += DT
    world.state["velocity_x"] = 0.0
    assert transition.off_course()[0] == pytest.approx([-DT * 40.0**2, 0.0])
    assert transition.wall()[0] == pytest.approx([0.0, -DT * 45.0**2])


def test_passing_is_symmetric_and_only_counts_near_cars(world: World) -> None:
    transition = Transition(world)
    world.step(np.zeros((1, 2, 2)))
    gained = transition.passing()[0]
    assert gained[1] == pytest.approx(0.5, abs=0.02)
    assert gained.sum() == pytest.approx(0.0, abs=1e-12)
    transition._before["progress"][0, 0] += 30.0
    assert transition.passing()[0].tolist() == [0.0, 0.0]


def test_rear_end_charges_only_the_faster_car_behind(world: World) -> None:
    transition = Transition(world)
    world.state["car_contact"] = True
    for behind, faster, charged in ((1, 1, [0.0, -9.0]), (0, 0, [-9.0, 0.0]), (1, 0, [0.0, 0.0])):
        note = world.contacts[0, 0]
        note["behind"], note["ahead"], note["faster"], note["closing"] = behind, 1 - behind, faster, 3.0
        world.contact_count[0] = 1
        assert transition.rear_end()[0] == pytest.approx(charged)
    world.contact_count[0] = 0
    assert transition.rear_end()[0].tolist() == [0.0, 0.0]
    assert transition.contact()[0].tolist() == [-1.0, -1.0]


def test_tyre_slip_caps_the_slip_ratio(world: World) -> None:
    transition = Transition(world)
    world.state["slip_ratio"][0] = [[0.5] * 4, [3.0] * 4]
    world.state["slip_angle"][0] = 0.1
    assert transition.tyre_slip()[0] == pytest.approx([-0.2, -0.4])


def test_total_is_the_weighted_sum(world: World) -> None:
    weights = RewardWeights(progress=2.0, off_course=0.0, wall=0.0, wall_touch=0.0, passing=1.0)
    transition = Transition(world)
    world.step(np.zeros((1, 2, 2)))
    components = transition.components()
    expected = 2.0 * components["progress"] + components["passing"]
    assert total(components, weights) == pytest.approx(expected)
    assert set(components) == set(RewardWeights.model_fields)
