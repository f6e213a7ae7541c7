"""Blue flags: who is shown one, and what holding up costs."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.sim.blue_flags import NOBODY, show_blue_flags
from nathlon.sim.physics.pit_lane import IN_BOX
from nathlon.sim.rules import BlueFlagParameters, blue_flag_parameters, load_rules
from nathlon.sim.state import CAR_STATE

LAP_M = 5000.0
RULES = BlueFlagParameters(shown=2.0, close=1.0, patience=3.0, penalty=5.0)


def race(*progress: float) -> NDArray[np.void]:
    """Cars at 50 m/s that have come so far."""
    state = np.zeros((1, len(progress)), CAR_STATE)
    state["progress"], state["velocity_x"], state["driving"] = progress, 50.0, True
    state["flagged_for"] = NOBODY
    return state


def shown(state: NDArray[np.void], seconds: float = 0.1) -> list[int]:
    """Whom each car is to let by, after so many seconds as they are now."""
    for _ in range(round(seconds / 0.1)):
        show_blue_flags(state, 0.1, LAP_M, RULES)
    return state["flagged_for"][0].tolist()


def test_who_is_about_to_be_lapped_is_shown_a_flag() -> None:
    # The second is 80 m behind the first on the road, and a lap less 80 m ahead in the race.
    assert shown(race(1000.0, 5920.0)) == [1, NOBODY]
    # Two laps are as good as one, further away than two seconds nobody looks.
    assert shown(race(1000.0, 10_920.0)) == [1, NOBODY]
    assert shown(race(1000.0, 5890.0)) == [NOBODY, NOBODY]
    # The nearest of two.
    assert shown(race(1000.0, 5920.0, 5960.0)) == [2, NOBODY, NOBODY]


def test_rivals_and_those_who_unlap_themselves_are_not_let_by() -> None:
    assert shown(race(1000.0, 920.0)) == [NOBODY, NOBODY]
    assert shown(race(6000.0, 920.0)) == [NOBODY, NOBODY]
    # Nor who has just gone by.
    assert shown(race(1000.0, 6010.0)) == [NOBODY, NOBODY]


@pytest.mark.parametrize("car", [0, 1])
def test_nobody_is_shown_a_flag_in_the_pit_lane_or_for_a_car_there(car: int) -> None:
    state = race(1000.0, 5920.0)
    state["stage"][0, car] = IN_BOX
    assert shown(state) == [NOBODY, NOBODY]


def test_holding_up_costs_a_penalty_each_time_that_patience_is_over() -> None:
    state = race(1000.0, 5970.0)
    shown(state, 2.9)
    assert state["penalties"].tolist() == [[0, 0]]
    shown(state, 0.2)
    assert (state["penalties"][0, 0], state["hold_ups"][0, 0], state["penalty_s"][0, 0]) == (1, 1, 5.0)
    shown(state, 3.0)
    assert (state["penalties"][0, 0], state["penalties"][0, 1]) == (2, 0)


def test_letting_by_in_time_costs_nothing() -> None:
    state = race(1000.0, 5970.0, 5940.0)
    shown(state, 2.5)
    state["progress"][0, 1] = 6010.0
    # Patience begins anew for the next one, and only from close by.
    assert shown(state, 2.5) == [2, NOBODY, NOBODY]
    assert state["held_up_s"][0, 0] == 0.0
    state["progress"][0, 2] = 5970.0
    shown(state, 2.5)
    assert not state["penalties"].any()


def test_only_rules_with_blue_flags_show_any() -> None:
    assert blue_flag_parameters(load_rules("sporting")) is None
    flags = blue_flag_parameters(load_rules("blue_flags"))
    assert flags is not None
    assert flags.close < flags.shown
    same = load_rules("blue_flags").model_dump(exclude={"name", "description", "blue_flags"})
    assert same == load_rules("sporting").model_dump(exclude={"name", "description", "blue_flags"})
