"""Measures of other worlds as expressions."""

from __future__ import annotations

import pytest

from nathlon.arena.world import WorldError
from nathlon.arena.worlds.formula import Formula
from nathlon.arena.worlds.seat_record import SeatRecord
from nathlon.sim.errors import InputError
from nathlon.sim.expressions import Quantity

NEAREST = {"nearest": Quantity("m", 0.0, 1e4, "sum of distances to the prey")}


def test_a_formula_is_computed_of_what_infos_add_up_to() -> None:
    formula = Formula("nearest / steps + 2 * m * (total > 10)", NEAREST)
    assert formula(SeatRecord(total=11.0, steps=4, infos={"nearest": 10.0})) == pytest.approx(4.5)
    assert formula.unit == "m"


def test_it_is_about_what_is_declared() -> None:
    with pytest.raises(InputError, match="column 1: 'nearest' is no quantity"):
        Formula("nearest / steps")
    with pytest.raises(InputError, match="column 1: m and a pure number do not go together"):
        Formula("nearest + total", NEAREST)


@pytest.mark.parametrize("infos", [{}, {"nearest": float("nan")}])
def test_what_infos_lack_voids_the_episode_with_a_sentence(infos: dict[str, float]) -> None:
    with pytest.raises(WorldError, match="where 'nearest' is no finite number"):
        Formula("nearest / steps", NEAREST)(SeatRecord(steps=3, infos=infos))
