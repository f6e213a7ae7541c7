"""Where on the lap a test is held."""

from __future__ import annotations

import numpy as np

from nathlon.selection.battery.skill import Skill
from nathlon.sim.scenario import load_scenario
from nathlon.sim.scenario_start import AnywhereStart
from nathlon.sim.track import load_track

DRAWS = 16
"""Starts that tell how far back a run may begin."""


def stretch(skill: Skill, circuit: str) -> tuple[float, float] | None:
    """From the farthest start of an entrant to the finish, m from the line; None for a lap and more.

    The first is negative before the line. A test that begins anywhere or ends by the clock has none either.

    Raises:
        InputError: if the circuit has no room for it.
    """
    scenario, track = load_scenario(skill.scenario), load_track(circuit)
    if isinstance(scenario.start, AnywhereStart):
        return None
    starts = [scenario.place(track, np.random.default_rng(seed)) for seed in range(DRAWS)]
    slots = [slot - 1 for slot in skill.slots]
    begin = min(float(start.distance[slots].min()) for start in starts)
    end = float(starts[0].finish[0])
    return (round(begin), round(end)) if end - begin < track.length else None
