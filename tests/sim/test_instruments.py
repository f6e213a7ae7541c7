"""Quantities of racing cars, read from worlds in which they are known by other means."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.sim.car import load_car
from nathlon.sim.conditions import Conditions, Start
from nathlon.sim.episode import Episodes
from nathlon.sim.instruments import QUANTITIES, Instruments, Transition
from nathlon.sim.state import CAR_STATE, CONTACT
from nathlon.sim.track import KERB_LEFT, LEFT, load_track
from nathlon.sim.world import World
from tests.support.driving import GT3, stadium, world_with

DT = 0.1
TRACK = load_track("lindenring")
INSTRUMENTS = Instruments(TRACK, GT3, DT)
NOBODY = np.zeros(0, CONTACT), np.zeros(0, np.int64)


def read(name: str, before: NDArray[np.void], after: NDArray[np.void]) -> list[float]:
    return INSTRUMENTS.read([name], Transition(before, after, *NOBODY))[name][0].tolist()


def at(progress: list[float], **fields: list[float]) -> NDArray[np.void]:
    """One race of cars at these places of the Lindenring."""
    state = np.zeros((1, len(progress)), CAR_STATE)
    state["driving"] = True
    state["progress"] = progress
    state["row"] = np.mod(progress, TRACK.length) / TRACK.spacing
    for name, values in fields.items():
        state[name][0] = values
    return state


def step(world: World, actions: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """All quantities of one step of a world."""
    before = world.state.copy()
    world.step(actions)
    contacts = world.new_contacts(0)
    transition = Transition(before, world.state, contacts, np.zeros(len(contacts), np.int64))
    return Instruments(world.track, world.car, DT).read(QUANTITIES, transition)


def test_everything_that_is_read_in_races_is_finite_and_within_its_range() -> None:
    rng = np.random.default_rng(1)
    episodes = Episodes("lindenring", "gt3", "1v7", races=4)
    episodes.start(range(4), [np.random.default_rng(race) for race in range(4)])
    world = episodes.world
    instruments = Instruments(world.track, world.car, episodes.step_s)
    for _ in range(100):
        before = world.state.copy()
        episodes.step(rng.uniform([-0.5, -0.3], [1.0, 0.3], (4, 8, 2)).astype(np.float32))
        transition = Transition(before, world.state, episodes.contacts, episodes.contact_races)
        for name, values in instruments.read(QUANTITIES, transition).items():
            assert values.shape == (4, 8), name
            low, high = QUANTITIES[name].low, QUANTITIES[name].high
            assert np.isfinite(values).all(), name
            assert ((low <= values) & (values <= high)).all(), name


def test_tyres_stand_off_course_where_the_world_says_so() -> None:
    """Three tyres or more beyond road and kerbs, which the world counts itself from step to step."""
    places = np.linspace(0.0, TRACK.length, 40, endpoint=False)
    lateral = np.linspace(-12.0, 12.0, 49)
    seen = set()
    world = World(TRACK, GT3, 1, 1)
    for place in places:
        for aside in lateral:
            start = [np.array([number]) for number in (place, aside, 0.1, 0.0, np.inf)]
            world.reset(0, Start(*start))
            before = world.state.copy()
            world.step(np.zeros((1, 1, 2)), 1)
            out = Instruments(TRACK, GT3, 1 / 60).read(["out"], Transition(before, before, *NOBODY))["out"]
            assert (out[0, 0] >= 3) == world.state["off_course"][0, 0]
            seen.add(out[0, 0])
    assert seen == {0.0, 1.0, 2.0, 3.0, 4.0}


def test_a_tyre_on_a_kerb_is_beyond_the_edge_and_not_out() -> None:
    kerbs = np.flatnonzero(TRACK.table[:, KERB_LEFT] == TRACK.table[:, KERB_LEFT].max())
    row = int(kerbs[len(kerbs) // 2])
    edge, kerb = TRACK.table[row, [LEFT, KERB_LEFT]]
    half = GT3.body.front_track_m / 2
    for over, expected in ((-0.3, (0.0, 0.0)), (0.3, (2.0, 0.0)), (kerb + 0.3, (0.0, 2.0))):
        state = at([row * TRACK.spacing], lateral=[edge - half + over])
        found = INSTRUMENTS.read(["kerb", "out", "edge"], Transition(state, state, *NOBODY))
        assert (found["kerb"][0, 0], found["out"][0, 0]) == expected
        assert found["edge"][0, 0] == pytest.approx(-over, abs=0.1)


def test_what_is_gained_is_of_the_step() -> None:
    before = at([100.0], steering=[0.1])
    after = at([106.0], steering=[0.05], velocity_x=[60.0], velocity_y=[-80.0])
    after["wear"] = 0.002
    assert read("progress", before, after) == [6.0]
    assert read("speed", before, after) == [100.0]
    assert read("steering_rate", before, after) == pytest.approx([-0.5])
    assert read("wear_rate", before, after) == pytest.approx([0.02])


def test_gaps_are_measured_the_shorter_way_round_to_those_who_drive() -> None:
    lap = TRACK.length
    before = at([10.0, lap - 10.0, 3 * lap + 40.0, 60.0])
    after = at([11.0, lap - 7.0, 3 * lap + 41.0, 60.0])
    after["driving"][0, 3] = False
    assert read("gap_ahead", before, after)[:3] == pytest.approx([30.0, 18.0, 500.0])
    assert read("gap_behind", before, after)[:3] == pytest.approx([18.0, 500.0, 30.0])
    assert read("closing_ahead", before, after)[:3] == pytest.approx([0.0, 20.0, 0.0], abs=1e-6)
    assert read("closing_behind", before, after)[:3] == pytest.approx([20.0, 0.0, 0.0], abs=1e-6)
    alone = at([10.0])
    assert read("gap_ahead", alone, alone) == [500.0]
    assert read("nearest", alone, alone) == [500.0]


def test_a_car_beside_is_ahead_and_near() -> None:
    state = at([10.0, 10.0], x=[0.0, 1.5], y=[0.0, 2.0])
    assert read("gap_ahead", state, state) == [0.0, 0.0]
    assert read("gap_behind", state, state) == [500.0, 500.0]
    assert read("nearest", state, state) == [2.5, 2.5]


def test_a_push_from_behind_is_a_contact_of_both_and_the_fault_of_one() -> None:
    world = world_with(stadium(), [1300.0, 1294.0], speed=[40.0, 50.0])
    counted = np.zeros(2)
    for _ in range(3):
        found = step(world, np.zeros((1, 2, 2)))
        counted += found["contacts"][0]
        if counted.any():
            break
    assert counted.tolist() == [1.0, 1.0]
    assert found["touching"][0].tolist() == [1.0, 1.0]
    assert found["contacts_at_fault"][0].tolist() == [0.0, 1.0]


def test_wear_is_that_of_the_tyres() -> None:
    world = World(TRACK, load_car("gt3"), 1, 1, Conditions(wear_rate=50.0))
    numbers = [np.array([number]) for number in (0.0, 0.0, 0.0, 40.0, np.inf)]
    world.reset(0, Start(*numbers))
    gathered = 0.0
    for _ in range(20):
        gathered += DT * step(world, np.array([[[-1.0, 0.3]]]))["wear_rate"][0, 0]
    assert gathered == pytest.approx(float(world.state["wear"].mean()))
    assert gathered > 1e-6
