"""The mirror image of an observation is what is seen from the mirror image of a race."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from nathlon.policies.training.mirrored import mirror, turned
from nathlon.sim.observation import PLANNED, ObservationSpec
from nathlon.sim.plan import COLUMNS, SPEED, Plan
from nathlon.sim.track import (
    BANK,
    CURVATURE,
    KERB_LEFT,
    KERB_RIGHT,
    LEFT,
    RIGHT,
    RUNOFF_LEFT,
    RUNOFF_RIGHT,
    TANGENT_Y,
    TWIST,
    WALL_LEFT,
    WALL_RIGHT,
    Track,
    Y,
    load_track,
)
from nathlon.sim.world import World
from tests.support.driving import world_with

TRACK = load_track("porto-sereno")
SPEC = ObservationSpec(version=PLANNED, course_points=8, cars_ahead=2, cars_behind=2, walls=True)


def image(track: Track) -> Track:
    """The circuit in the mirror: north is south."""
    table, edges = track.table.copy(), track.edges.reshape(-1, 3, 4).copy()
    table[:, [Y, TANGENT_Y, CURVATURE, BANK, TWIST]] *= -1.0
    for one, other in (
        (LEFT, RIGHT),
        (WALL_LEFT, WALL_RIGHT),
        (KERB_LEFT, KERB_RIGHT),
        (RUNOFF_LEFT, RUNOFF_RIGHT),
    ):
        table[:, [one, other]] = table[:, [other, one]]
    edges[:, :, :3] = edges[:, :, [2, 1, 0]]
    edges[:, 1] *= -1.0
    return replace(track, table=table, edges=edges.reshape(-1, 12))


def plan(side: float) -> Plan:
    """A plan as none is driven, or on the other side its mirror image."""
    table = np.random.default_rng(4).normal(size=(len(TRACK.table), COLUMNS)).cumsum(0) * 0.01
    table[:, SPEED] = 30.0
    table[:, np.arange(COLUMNS)[1:]] *= np.where(np.arange(1, COLUMNS) == SPEED, 1.0, side)
    return Plan.of_lap(table)


def raced(track: Track, side: float, actions: NDArray[np.float64]) -> World:
    """Three cars that have driven for a while over kerbs and into each other, or into the other side."""
    world = world_with(
        track,
        [300.0, 306.0, 312.0],
        lateral=[side * 1.5, side * -0.5, side * 7.0],
        speed=[30.0, 24.0, 22.0],
        heading=[side * -0.05, side * 0.02, 0.0],
    )
    world.show(plan(side))
    for action in actions:
        world.step(action * [1.0, side])
    return world


def test_an_observation_turns_as_the_race_does() -> None:
    rng = np.random.default_rng(1)
    actions = rng.uniform([-0.3, -0.2], [1.0, 0.2], (12, 1, 3, 2))
    here, there = raced(TRACK, 1.0, actions), raced(image(TRACK), -1.0, actions)
    assert here.state["contacts"].any()
    assert here.state["off_course_s"].any()
    np.testing.assert_allclose(here.state["progress"], there.state["progress"], atol=1e-3)
    races, cars = np.zeros(3, np.int64), np.arange(3)
    seen, image_seen = (torch.from_numpy(world.observe(SPEC, races, cars)) for world in (here, there))
    assert not torch.allclose(seen, image_seen, atol=0.1)
    torch.testing.assert_close(mirror(SPEC).seen(seen), image_seen, atol=2e-3, rtol=2e-3)


def test_steering_turns_and_pedals_do_not() -> None:
    assert turned(torch.tensor([[0.5, 0.25], [-1.0, -0.5]])).tolist() == [[0.5, -0.25], [-1.0, 0.5]]
