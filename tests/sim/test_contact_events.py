"""What is noted of hits between cars, on the stadium's first straight, which runs east along y = 0."""

from __future__ import annotations

import numpy as np
import pytest

from nathlon.sim.clock import AGENT_DT
from tests.support.driving import GT3, drive, stadium, world_with


def test_a_hit_from_behind_is_noted_with_what_was_before_it() -> None:
    world = world_with(stadium(), [106.0, 100.0], lateral=[0.4, -0.4], speed=[50.0, 60.0])
    while not world.contact_count[0]:
        world.step(np.full((1, 2, 2), [0.3, 0.0]), 1)
    (contact,) = world.new_contacts(0)
    assert (contact["behind"], contact["ahead"], contact["faster"]) == (1, 0, 1)
    assert contact["closing"] == pytest.approx(10.0, abs=0.3)
    assert (contact["relative_x"], contact["relative_y"]) == pytest.approx((10.0, 0.0), abs=0.3)
    # 1.4 m at 10 m/s; the point lies between the two, in the middle of the overlap.
    assert contact["time"] == pytest.approx(0.14, abs=0.02)
    assert world.state[0, 1]["x"] < contact["x"] < world.state[0, 0]["x"]
    assert contact["y"] == pytest.approx(0.0, abs=0.05)
    assert world.state["contacts_faster_behind"].tolist() == [[0, 1]]
    assert world.state["contacts"].tolist() == [[1, 1]]


def test_behind_is_behind_across_the_line() -> None:
    track = stadium()
    world = world_with(track, [2.0, track.length - 4.0], speed=[50.0, 60.0])
    # The car behind is a lap of progress ahead: what counts is the road between them.
    while not world.contact_count[0]:
        drive(world, 0.3)
    assert world.new_contacts(0)["behind"].tolist() == [1]
    assert world.state["contacts_faster_behind"].tolist() == [[0, 1]]


def test_a_long_push_is_one_contact() -> None:
    world = world_with(stadium(), [105.0, 100.0], speed=[30.0, 31.0])
    actions = np.array([[[-0.1, 0.0], [1.0, 0.0]]])
    touching = noted = 0
    for _ in range(30):
        world.step(actions)
        touching += int(world.state[0, 0]["car_contact"])
        noted += int(world.contact_count[0])
    assert touching > 20
    assert noted == 1
    assert world.state["contacts"].tolist() == [[1, 1]]


@pytest.mark.parametrize(("apart_s", "contacts"), [(0.5, 1), (1.5, 2)])
def test_touching_again_is_another_after_a_second(apart_s: float, contacts: int) -> None:
    world = world_with(stadium(), [105.0, 100.0], speed=[30.0, 36.0])
    noted = 0
    for speed, seconds in ((36.0, 0.2), (28.0, apart_s), (45.0, 1.0)):
        chaser = world.state[0, 1]
        chaser["velocity_x"] = chaser["world_velocity_x"] = speed
        chaser["spin"] = speed / GT3.wheel.radius_m
        for _ in range(round(seconds / AGENT_DT)):
            world.step(np.array([[[0.2, 0.0], [0.0, 0.0]]]))
            noted += int(world.contact_count[0])
    assert noted == contacts


def test_three_in_a_row_are_two_contacts() -> None:
    world = world_with(stadium(), [110.0, 105.0, 100.0], speed=[30.0, 30.0, 40.0])
    pairs = set()
    for _ in range(10):
        drive(world, 0.2)
        pairs |= {(int(c["behind"]), int(c["ahead"])) for c in world.new_contacts(0)}
    assert pairs == {(2, 1), (1, 0)}
