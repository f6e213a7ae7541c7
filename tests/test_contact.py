"""Contact: conservation laws, and crashes whose outcome is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from sim.car import parameters
from sim.physics.chassis import set_direction
from sim.physics.contact import CAR_RESTITUTION, collide, hit_wall
from sim.state import CAR_STATE
from sim.track import TANGENT_X, TANGENT_Y, WALL_LEFT, WALL_RIGHT, X, Y, load_track
from sim.world import World
from tests.driving import GT3, drive, stadium, start_at, world_with

P = parameters(GT3)
MASS, INERTIA = GT3.body.mass_kg, GT3.body.yaw_inertia_kg_m2
LENGTH = GT3.body.length_m


def number(least: float, most: float) -> st.SearchStrategy[float]:
    return st.floats(least, most, allow_nan=False)


def face(cars: NDArray[np.void]) -> None:
    """Make the cars' directions those of their yaw."""
    for car in cars:
        set_direction(car)


@st.composite
def cars(draw: st.DrawFn) -> NDArray[np.void]:
    """Two cars close to each other in any motion."""
    pair = np.zeros(2, CAR_STATE)
    for car in pair:
        car["x"], car["y"] = draw(number(-2.5, 2.5)), draw(number(-2.5, 2.5))
        car["yaw"], car["yaw_rate"] = draw(number(-4.0, 4.0)), draw(number(-4.0, 4.0))
        car["world_velocity_x"], car["world_velocity_y"] = draw(number(-60, 60)), draw(number(-60, 60))
    face(pair)
    return pair


def energy(pair: NDArray[np.void]) -> float:
    squares = pair["world_velocity_x"] ** 2 + pair["world_velocity_y"] ** 2
    return float((0.5 * MASS * squares + 0.5 * INERTIA * pair["yaw_rate"] ** 2).sum())


def momenta(pair: NDArray[np.void], where: NDArray[np.void]) -> NDArray[np.float64]:
    """Momentum x and y, and angular momentum about the origin, with the cars at the places of `where`."""
    x, y = MASS * pair["world_velocity_x"], MASS * pair["world_velocity_y"]
    return np.array([x.sum(), y.sum(), (where["x"] * y - where["y"] * x + INERTIA * pair["yaw_rate"]).sum()])


@settings(max_examples=200, deadline=None)
@given(cars())
def test_contact_keeps_both_momenta_and_never_makes_energy(pair: NDArray[np.void]) -> None:
    before = pair.copy()
    closing = collide(pair[0], pair[1], P)
    assume(closing >= 0.0)
    # The impulse acts where the cars touched, before they are pushed apart; scale: 1e5 N s.
    np.testing.assert_allclose(momenta(pair, before), momenta(before, before), rtol=0, atol=1e-6)
    assert energy(pair) <= energy(before) * (1 + 1e-12) + 1e-6
    if closing == 0.0:
        assert energy(pair) == energy(before)


def test_contact_is_the_same_for_both_cars() -> None:
    # Drawn at random, not searched: where two axes overlap exactly alike, either may be taken.
    rng, touched = np.random.default_rng(5), 0
    for _ in range(300):
        pair = np.zeros(2, CAR_STATE)
        for name, most in (("x", 2.5), ("y", 2.5), ("yaw", 4.0), ("yaw_rate", 4.0)):
            pair[name] = rng.uniform(-most, most, 2)
        pair["world_velocity_x"], pair["world_velocity_y"] = rng.uniform(-60.0, 60.0, (2, 2))
        face(pair)
        swapped = pair[::-1].copy()
        closing = collide(pair[0], pair[1], P)
        assert closing == pytest.approx(collide(swapped[0], swapped[1], P), abs=1e-9)
        for name in ("x", "y", "world_velocity_x", "world_velocity_y", "yaw_rate"):
            np.testing.assert_allclose(pair[name], swapped[name][::-1], atol=1e-9)
        touched += closing > 0.0
    assert touched > 50


@settings(max_examples=200, deadline=None)
@given(
    st.floats(-math.pi, math.pi),
    st.sampled_from([(1, 1), (1, -1), (-1, 1), (-1, -1)]),
    number(-60, 60),
    number(-60, 60),
    number(-4, 4),
)
def test_wall_turns_the_corner_back_and_never_makes_energy(
    yaw: float, corner: tuple[int, int], u: float, v: float, turn: float
) -> None:
    car = np.zeros(1, CAR_STATE)
    car["yaw"], car["yaw_rate"], car["world_velocity_x"], car["world_velocity_y"] = yaw, turn, u, v
    face(car)
    x, y = corner[0] * LENGTH / 2, corner[1] * GT3.body.width_m / 2
    arm_x, arm_y = x * math.cos(yaw) - y * math.sin(yaw), x * math.sin(yaw) + y * math.cos(yaw)
    before = energy(car)
    into = car[0]["world_velocity_y"] + turn * arm_x
    hit_wall(car[0], arm_x, arm_y, 0.0, 1.0, 0.1, P)
    assert car[0]["y"] == pytest.approx(0.1)
    assert energy(car) <= before * (1 + 1e-12) + 1e-6
    if into >= 0.0:
        assert energy(car) == before


def test_square_hit_from_behind_follows_the_textbook() -> None:
    pair = np.zeros(2, CAR_STATE)
    face(pair)
    pair["x"] = [0.0, LENGTH - 0.05]
    pair["world_velocity_x"] = [50.0, 40.0]
    assert collide(pair[0], pair[1], P) == pytest.approx(10.0)
    # Equal masses: the mean keeps, the difference turns round by the restitution.
    np.testing.assert_allclose(
        pair["world_velocity_x"], [45.0 - 5.0 * CAR_RESTITUTION, 45.0 + 5.0 * CAR_RESTITUTION]
    )
    np.testing.assert_allclose(pair["yaw_rate"], 0.0, atol=1e-12)
    assert pair["x"][1] - pair["x"][0] == pytest.approx(LENGTH)


def test_cars_apart_do_not_touch() -> None:
    pair = np.zeros(2, CAR_STATE)
    pair["x"], pair["world_velocity_x"] = [0.0, LENGTH + 0.01], [50.0, 0.0]
    untouched = pair.copy()
    assert collide(pair[0], pair[1], P) == -1.0
    assert pair.tobytes() == untouched.tobytes()


def test_head_on_at_ninety_metres_a_second_does_not_tunnel() -> None:
    world = world_with(stadium(), [100.0, 140.0], speed=45.0, heading=[0.0, np.pi])
    first, second = drive(world, 0.0, seconds=1.5)[0]
    assert second["x"] - first["x"] > LENGTH
    # They meet at 120 m and part at 0.15 of their speed or less.
    assert first["x"] < 120.0 < second["x"]
    assert abs(first["velocity_x"]) < CAR_RESTITUTION * 45.0
    assert first["contacts"] == second["contacts"] == 1


def test_a_pile_of_eight_comes_to_rest_and_lets_go() -> None:
    turned = [0.2 * i for i in range(8)]
    places = [100.0 + 3.0 * i for i in range(8)]
    world = world_with(
        stadium(),
        places,
        lateral=[0.8 * (-1) ** i for i in range(8)],
        speed=[60.0 - 6.0 * i for i in range(8)],
        heading=turned,
    )
    cars = drive(world, -1.0, 0.3, seconds=10.0)[0]
    assert np.hypot(cars["velocity_x"], cars["velocity_y"]).max() < 0.05
    assert np.abs(cars["yaw_rate"]).max() < 0.05
    settled = cars.copy()
    for i in range(8):
        for j in range(i + 1, 8):
            a, b = settled[i].copy(), settled[j].copy()
            if collide(a, b, P) >= 0.0:
                moved = math.hypot(a["x"] - settled[i]["x"], a["y"] - settled[i]["y"])
                # Half the overlap; a pile is resolved pair by pair, which leaves a little.
                assert moved < 0.02


def test_walls_hold_at_any_speed_and_angle() -> None:
    track, rng, races = load_track("lindenring"), np.random.default_rng(1), 24
    world = World(track, GT3, races, 1)
    for race in range(races):
        where, speed, heading = rng.uniform((0.0, 20.0, -1.5), (track.length, 80.0, 1.5))
        world.reset(race, start_at([where], 0.0, float(speed), float(heading)))
    furthest = -np.inf
    for _ in range(120):
        world.step(rng.uniform((0.0, -1.0), (1.0, 1.0), (races, 1, 2)))
        cars = world.state[:, 0]
        cos, sin = np.cos(cars["yaw"]), np.sin(cars["yaw"])
        for along, across in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            x = cars["x"] + along * LENGTH / 2 * cos - across * GT3.body.width_m / 2 * sin
            y = cars["y"] + along * LENGTH / 2 * sin + across * GT3.body.width_m / 2 * cos
            nearest = np.hypot(track.table[:, [X]] - x, track.table[:, [Y]] - y).argmin(axis=0)
            row = track.table[nearest]
            left = (y - row[:, Y]) * row[:, TANGENT_X] - (x - row[:, X]) * row[:, TANGENT_Y]
            beyond = np.maximum(left - row[:, WALL_LEFT], -row[:, WALL_RIGHT] - left)
            furthest = max(furthest, float(beyond.max()))
    assert world.state["wall_contact"].any()
    # Only the deepest corner is pushed back at once: a second one may lag by a few substeps.
    assert furthest < 0.3


def test_blame_goes_to_the_faster_car_behind() -> None:
    world = world_with(stadium(), [106.0, 100.0], speed=[50.0, 60.0])
    while not world.state["car_contact"].any():
        drive(world, 0.3)
    assert world.impact[0, 0, 1] == world.impact[0, 1, 0] == pytest.approx(10.0, abs=0.5)
    assert world.blame[0].tolist() == [[False, False], [True, False]]
    assert world.state["contacts_faster_behind"].tolist() == [[0, 1]]
    assert world.state["contacts"].tolist() == [[1, 1]]


def test_blame_is_the_same_across_the_line() -> None:
    track = stadium()
    world = world_with(track, [2.0, track.length - 4.0], speed=[50.0, 60.0])
    # The car behind is a lap of progress ahead: what counts is the road between them.
    while not world.state["car_contact"].any():
        drive(world, 0.3)
    assert world.state["contacts_faster_behind"].tolist() == [[0, 1]]


def test_a_long_push_is_one_contact() -> None:
    world = world_with(stadium(), [105.0, 100.0], speed=[30.0, 31.0])
    actions = np.array([[[-0.1, 0.0], [1.0, 0.0]]])
    touching = 0
    for _ in range(30):
        world.step(actions)
        touching += int(world.state[0, 0]["car_contact"])
    assert touching > 20
    assert world.state["contacts"].tolist() == [[1, 1]]
