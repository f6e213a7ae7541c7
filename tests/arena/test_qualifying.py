"""Qualifying orders entrants by their flying lap."""

from __future__ import annotations

import pytest

from nathlon.arena.entrant import enter
from nathlon.arena.pool import Pool
from nathlon.arena.qualifying import qualify


def test_the_faster_start_in_front_and_those_without_a_lap_behind(pool: Pool) -> None:
    names = ["driver:pace=0.2", "driver:pace=0.8", "driver:pace=0.9"]
    entrants = [enter(name, "lindenring", "gt3") for name in names]
    timed = qualify(pool, entrants, seed=1)
    # At a fifth of the pace a lap of 5.8 km takes longer than the six minutes there are.
    assert [entrant.source for entrant, _ in timed] == [names[2], names[1], names[0]]
    fast, slow, none = (lap_s for _, lap_s in timed)
    assert none is None
    assert fast is not None
    assert slow is not None
    assert slow / fast == pytest.approx(0.9 / 0.8, rel=0.03)
