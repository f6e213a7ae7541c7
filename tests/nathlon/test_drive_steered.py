"""A scripted driver steers a start and a bend through the page's own inputs, in a real browser."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser

from benchmarks.scripted_drivers import KEYS, WHEEL, Style
from benchmarks.steered_page import PAD, PADS, LedClock, steer
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.runner import run_match
from nathlon.policies.driver import Driver
from nathlon.sim.world import World
from tests.support.driven_page import MAP, Drive
from tests.support.drives import served

CIRCUIT, CAR = "porto-sereno", "gt3"
UNTIL_M = 320.0
"""Beyond the first bend, Municipio, between walls."""


def driver_s() -> float:
    """When the built-in driver is there, s after the start."""
    match = Match("race", "x", "drive:laps=1,cars=1", CIRCUIT, CAR, ("d",), ("",), (Race(1, (Seat(0),)),))
    there = np.inf

    def look(world: World) -> None:
        nonlocal there
        if world.state["progress"][0, 0] >= UNTIL_M:
            there = min(there, float(world.time[0]))

    run_match(match, [Driver(CIRCUIT, CAR)], look)
    return there


@pytest.mark.parametrize(("style", "share"), [(KEYS, 1.15), (WHEEL, 1.1)], ids=["keys", "gamepad"])
def test_a_start_and_a_bend_are_driven_through_the_page(
    browser: Browser, tmp_path: Path, style: Style, share: float
) -> None:
    clock = LedClock()
    with served(tmp_path, clock=clock) as both:
        drive = Drive(browser, *both, script=MAP + PADS)
        drive.page.select_option("[name=circuit]", CIRCUIT)
        drive.page.select_option("[name=device]", "keys" if style.keys else PAD)
        drive.begin(cars="1", seat="1", laps="1")
        done = steer(drive.page, drive.room, clock, style, UNTIL_M)
        drive.picture("steered-keys" if style.keys else "steered-pad")
        clock.let_go()
        drive.close()
    assert done.progress_m >= UNTIL_M
    assert (done.off_course_s, done.wall_s) == (0.0, 0.0)
    assert done.time_s < share * driver_s()
    assert done.turns > 20
