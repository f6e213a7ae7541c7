"""The driver's plan: the line and speeds that it follows, for the grip that there is."""

from __future__ import annotations

import numpy as np
import pytest

from nathlon.policies.driver import practised, shown_plan
from nathlon.policies.driver.shown_plan import plan_of, show_plan
from nathlon.sim.car import Car, compound_ratio, load_car
from nathlon.sim.conditions import Conditions
from nathlon.sim.observation import ANY_CAR, PLANNED, ObservationSpec
from nathlon.sim.physics.course import SurfaceGrip
from nathlon.sim.plan import CURVATURE, DIRECTION, OFFSET, SPEED, Plan, X, Y
from nathlon.sim.track import Track, load_track
from nathlon.sim.world import World

TRACK, CAR = load_track("lindenring"), load_car("gt3")


def test_it_is_what_the_driver_follows() -> None:
    line, table = practised(TRACK, CAR), plan_of(TRACK, CAR).table
    assert np.array_equal(table[:-1, SPEED], line.speed)
    assert np.array_equal(table[:-1, OFFSET], line.offset)
    # The table closes: its last row is the first one, a turn later.
    assert np.array_equal(np.delete(table[-1], DIRECTION), np.delete(table[0], DIRECTION))
    assert abs(table[-1, DIRECTION] - table[0, DIRECTION]) == pytest.approx(2.0 * np.pi)
    # Place, direction and curvature are of one line, but for what differences round off in 2 m.
    x, y = np.diff(table[:, [X, Y]], axis=0).T
    middle = 0.5 * (table[1:, DIRECTION] + table[:-1, DIRECTION])
    off = np.arctan2(y, x) - middle
    assert np.abs(np.arctan2(np.sin(off), np.cos(off))).max() < 0.01
    turned = np.diff(table[:, DIRECTION]) / np.hypot(x, y)
    np.testing.assert_allclose(turned, table[:-1, CURVATURE], atol=5e-3)


def test_it_is_made_once_for_those_who_see_it_and_for_the_grip_that_there_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[Car] = []

    def noted(track: Track, car: Car) -> Plan:
        asked.append(car)
        return Plan(np.zeros((len(track.table) + 1, 8)))

    monkeypatch.setattr(shown_plan, "plan_of", noted)
    conditions = Conditions(compound="racing-soft", grip=SurfaceGrip(tarmac=0.7))
    world = World(TRACK, CAR, 1, 1, conditions)
    show_plan(world, ObservationSpec(), ObservationSpec(version=ANY_CAR))
    assert not world.plans
    for _ in range(2):
        show_plan(world, ObservationSpec(), ObservationSpec(version=PLANNED))
    assert world.plans
    [car] = asked
    grip = 0.7 * compound_ratio(CAR.tyre.compound, "racing-soft")[0]
    assert car.tyre.friction_lateral[0] == pytest.approx(grip * CAR.tyre.friction_lateral[0])
