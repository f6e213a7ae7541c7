"""The tempers of the built-in driver: how near each comes to others, and that the fair one is the default."""

from __future__ import annotations

import numpy as np
import pytest

from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.runner import run_match
from nathlon.policies.load import load_policy
from nathlon.policies.sources import driver_settings
from nathlon.policies.temper import TEMPERS
from nathlon.sim.car import load_car
from nathlon.sim.errors import InputError
from nathlon.sim.world import World

CIRCUIT, CAR = "lindenring", "gt3"


def beside_m(temper: str) -> float:
    """How near a driver comes sideways, centre to centre, to those slower that it passes."""
    sources = ("driver:pace=0.6,lane=2.5", f"driver:pace=0.9,temper={temper}")
    policies = [load_policy(source, CIRCUIT, CAR) for source in sources]
    races = (Race(1, (Seat(0), Seat(1))),)
    match = Match("race", "passing", "race:laps=1,cars=2", CIRCUIT, CAR, sources, sources, races)
    nearest = np.inf

    def look(world: World) -> None:
        nonlocal nearest
        slow, fast = world.state[0]
        if abs(slow["progress"] - fast["progress"]) < load_car(CAR).body.length_m:
            nearest = min(nearest, abs(slow["lateral"] - fast["lateral"]))

    results = run_match(match, policies, look).sort("car")
    assert results["place"].to_list() == [2, 1]
    return float(nearest)


def test_the_calmer_a_driver_the_more_room_it_leaves() -> None:
    calm, fair, aggressive = map(beside_m, TEMPERS)
    assert calm > fair + 0.1
    assert fair > aggressive + 0.1


def test_a_driver_is_fair_unless_it_is_told_otherwise() -> None:
    assert driver_settings("driver:pace=0.9").temper == "fair"
    assert driver_settings("driver:pace=0.9,temper=calm") == (0.9, None, 0.0, 1.0, "calm", 0.0)
    with pytest.raises(InputError, match="temper is 'mad', expected one of calm, fair, aggressive"):
        driver_settings("driver:temper=mad")
