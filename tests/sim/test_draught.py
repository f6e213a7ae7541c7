"""Slipstream."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nathlon.sim.physics.draught import wake
from tests.support.closed_forms import G, downforce
from tests.support.driving import GT3, drive, stadium, world_with


class TestDraught:
    @settings(deadline=None)
    @given(st.floats(0.0, 150.0), st.floats(-20.0, 20.0))
    def test_wake_fades_with_distance_and_to_both_sides(self, behind: float, beside: float) -> None:
        strength = wake(behind, beside)
        assert 0.0 <= strength <= 1.0
        assert strength == wake(behind, -beside)
        assert strength <= wake(behind, 0.0) == pytest.approx(math.exp(-behind / 45.0))

    def test_there_is_none_ahead_or_beside(self) -> None:
        assert wake(-0.1, 0.0) == 0.0
        world = world_with(stadium(), [100.0, 100.0, 140.0], lateral=[0.0, 4.0, 0.0], speed=60.0)
        first, beside, ahead = drive(world, 0.5)[0]["draught"]
        assert ahead == 0.0
        assert first == pytest.approx(wake(40.0 - GT3.body.length_m, 0.0), rel=1e-3)
        # Four metres aside at 35 m are 1.6 half-widths of the wake.
        assert beside < 0.3 * first

    def test_follower_is_faster_at_the_top_and_corners_worse(self) -> None:
        world = world_with(stadium(), [150.0, 100.0], speed=78.0)
        leader, follower = drive(world, 1.0, seconds=15.0)[0]
        assert follower["velocity_x"] > leader["velocity_x"] + 0.5
        saved = 1.0 - GT3.aero.draught_downforce_share * follower["draught"]
        wanted = GT3.body.mass_kg * G + saved * downforce(GT3, follower["velocity_x"])
        assert follower["load"].sum() == pytest.approx(wanted, rel=1e-3)
