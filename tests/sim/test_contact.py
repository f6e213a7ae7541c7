"""Contact: conservation laws, and crashes whose outcome is known."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from nathlon.sim.car import parameters
from nathlon.sim.clock import DYNAMICS_DT
from nathlon.sim.physics.body import set_direction
from nathlon.sim.physics.contact import CAR_RESTITUTION, WALL_RESTITUTION, Touch, collide, hit_wall
from nathlon.sim.state import CAR_STATE
from nathlon.sim.track import TANGENT_X, TANGENT_Y, WALL_LEFT, WALL_RIGHT, X, Y
from nathlon.sim.world import World
from tests.support.driving import GT3, circle, drive, stadium, start_at, world_with

P = parameters(GT3)
MASS, INERTIA = GT3.body.mass_kg, GT3.body.yaw_inertia_kg_m2
LENGTH, WIDTH = GT3.body.length_m, GT3.body.width_m


def number(least: float, most: float) -> st.SearchStrategy[float]:
    return st.floats(least, most, allow_nan=False)


def resting_pair() -> NDArray[np.void]:
    """Two cars on one spot that face east."""
    pair = np.zeros(2, CAR_STATE)
    pair["mass"], pair["cos_yaw"] = MASS, 1.0
    return pair


def face(cars: NDArray[np.void]) -> None:
    """Make the cars' directions those of their yaw."""
    for car in cars:
        set_direction(car)


@st.composite
def cars(draw: st.DrawFn) -> NDArray[np.void]:
    """Two cars close to each other in any motion, of which one may be heavier."""
    pair = resting_pair()
    for car in pair:
        car["x"], car["y"] = draw(number(-2.5, 2.5)), draw(number(-2.5, 2.5))
        car["yaw"], car["yaw_rate"] = draw(number(-4.0, 4.0)), draw(number(-4.0, 4.0))
        car["world_velocity_x"], car["world_velocity_y"] = draw(number(-60, 60)), draw(number(-60, 60))
    pair[1]["mass"] += draw(number(0.0, 80.0))
    face(pair)
    return pair


def touch(pair: NDArray[np.void]) -> Touch:
    return Touch(*collide(pair[0], pair[1], DYNAMICS_DT, P, P))


def energy(pair: NDArray[np.void]) -> float:
    squares = pair["world_velocity_x"] ** 2 + pair["world_velocity_y"] ** 2
    return float((0.5 * pair["mass"] * squares + 0.5 * INERTIA * pair["yaw_rate"] ** 2).sum())


def momenta(pair: NDArray[np.void], where: NDArray[np.void]) -> NDArray[np.float64]:
    """Momentum x and y, and angular momentum about the origin, with the cars at the places of `where`."""
    x, y = pair["mass"] * pair["world_velocity_x"], pair["mass"] * pair["world_velocity_y"]
    return np.array([x.sum(), y.sum(), (where["x"] * y - where["y"] * x + INERTIA * pair["yaw_rate"]).sum()])


def overlap(a: np.void, b: np.void) -> float:
    """By how much (m) two boxes overlap on the axis on which they do so least; negative if apart."""
    depths = []
    for turned in (a["yaw"], b["yaw"]):
        for angle in (turned, turned + math.pi / 2):
            axis = np.array([math.cos(angle), math.sin(angle)])
            reach = sum(
                LENGTH / 2 * abs(math.cos(car["yaw"] - angle)) + WIDTH / 2 * abs(math.sin(car["yaw"] - angle))
                for car in (a, b)
            )
            depths.append(reach - abs(axis @ [b["x"] - a["x"], b["y"] - a["y"]]))
    return min(depths)


def deepest_overlap(field: NDArray[np.void]) -> float:
    return max(overlap(a, b) for a, b in combinations(field, 2))


class TestLaws:
    @settings(max_examples=300, deadline=None)
    @given(cars())
    def test_both_momenta_are_kept_and_energy_is_never_made(self, pair: NDArray[np.void]) -> None:
        before = pair.copy()
        closing = touch(pair).closing
        assume(closing >= 0.0)
        # The impulse acts where the cars touched, before they are pushed apart; scale: 1e5 N s.
        np.testing.assert_allclose(momenta(pair, before), momenta(before, before), rtol=0, atol=1e-6)
        assert energy(pair) <= energy(before) * (1 + 1e-12) + 1e-6
        if closing == 0.0:
            assert energy(pair) == energy(before)

    @settings(max_examples=200, deadline=None)
    @given(cars())
    def test_pushing_apart_leaves_the_common_centre_of_mass_and_no_overlap(
        self, pair: NDArray[np.void]
    ) -> None:
        before = pair.copy()
        assume(touch(pair).closing >= 0.0)
        for axis in ("x", "y"):
            assert (pair["mass"] * pair[axis]).sum() == pytest.approx((pair["mass"] * before[axis]).sum())
        assert overlap(*pair) < 1e-9

    @settings(max_examples=200, deadline=None)
    @given(cars())
    def test_they_touch_if_and_only_if_their_boxes_overlap(self, pair: NDArray[np.void]) -> None:
        depth = overlap(*pair)
        assume(abs(depth) > 1e-9)
        assert (touch(pair).closing >= 0.0) == (depth > 0.0)

    def test_it_is_the_same_for_both_cars(self) -> None:
        # Drawn at random, not searched: where two axes overlap exactly alike, either may be taken.
        rng, touched = np.random.default_rng(5), 0
        for _ in range(300):
            pair = resting_pair()
            for name, most in (("x", 2.5), ("y", 2.5), ("yaw", 4.0), ("yaw_rate", 4.0)):
                pair[name] = rng.uniform(-most, most, 2)
            pair["world_velocity_x"], pair["world_velocity_y"] = rng.uniform(-60.0, 60.0, (2, 2))
            face(pair)
            swapped = pair[::-1].copy()
            one, other = touch(pair), touch(swapped)
            assert one.closing == pytest.approx(other.closing, abs=1e-9)
            if one.closing >= 0.0:
                assert (one.x, one.y) == pytest.approx((other.x, other.y), abs=1e-9)
                assert (one.normal_x, one.normal_y) == pytest.approx((-other.normal_x, -other.normal_y))
            for name in ("x", "y", "world_velocity_x", "world_velocity_y", "yaw_rate"):
                np.testing.assert_allclose(pair[name], swapped[name][::-1], atol=1e-9)
            touched += one.closing > 0.0
        assert touched > 50

    @settings(max_examples=300, deadline=None)
    @given(
        st.floats(-math.pi, math.pi),
        st.sampled_from([(1, 1), (1, -1), (-1, 1), (-1, -1)]),
        number(-90, 90),
        number(-90, 90),
        number(-4, 4),
    )
    def test_wall_turns_the_corner_back_and_never_makes_energy(
        self, yaw: float, corner: tuple[int, int], u: float, v: float, turn: float
    ) -> None:
        car = resting_pair()[:1]
        car["yaw"], car["yaw_rate"], car["world_velocity_x"], car["world_velocity_y"] = yaw, turn, u, v
        face(car)
        x, y = corner[0] * LENGTH / 2, corner[1] * WIDTH / 2
        arm_x, arm_y = x * math.cos(yaw) - y * math.sin(yaw), x * math.sin(yaw) + y * math.cos(yaw)
        before = energy(car)
        into = v + turn * arm_x
        hit_wall(car[0], arm_x, arm_y, 0.0, 1.0, 0.1, P)
        assert car[0]["y"] == pytest.approx(0.1)
        assert energy(car) <= before * (1 + 1e-12) + 1e-6
        if into >= 0.0:
            assert energy(car) == before

    @settings(max_examples=50, deadline=None)
    @given(st.integers(0, 2**32))
    def test_a_crowd_between_walls_only_loses_energy(self, seed: int) -> None:
        # Coasting on a level road: engines, tyres and air can but brake. Fuel keeps the mass constant.
        rng = np.random.default_rng(seed)
        world = world_with(
            stadium(7.0, 8.0),
            (300.0 - 4.7 * np.arange(8)).tolist(),
            lateral=rng.uniform(-4.0, 4.0, 8).tolist(),
            speed=rng.uniform(0.0, 80.0, 8).tolist(),
            heading=rng.uniform(-0.6, 0.6, 8).tolist(),
        )
        before = after = energy(world.state[0])
        touched = False
        # Wheels turn as the road does: what spins them up again after a blow is taken from the cars.
        for _ in range(30):
            after = energy(drive(world, 0.0)[0])
            wheels = 0.5 * GT3.wheel.inertia_kg_m2 * (world.state[0]["spin"] ** 2).sum()
            assert after < before + wheels
            before = after
            touched |= bool(world.state[0]["car_contact"].any())
        assume(touched)


class TestOutcome:
    def test_square_hit_from_behind_follows_the_textbook(self) -> None:
        pair = resting_pair()
        pair["x"] = [0.0, LENGTH - 0.05]
        pair["world_velocity_x"] = [50.0, 40.0]
        hit = touch(pair)
        assert hit == pytest.approx(Touch(10.0, LENGTH / 2 - 0.025, 0.0, 1.0, 0.0))
        # Equal masses: the mean keeps, the difference turns round by the restitution.
        np.testing.assert_allclose(
            pair["world_velocity_x"], [45.0 - 5.0 * CAR_RESTITUTION, 45.0 + 5.0 * CAR_RESTITUTION]
        )
        np.testing.assert_allclose(pair["yaw_rate"], 0.0, atol=1e-12)
        assert pair["x"][1] - pair["x"][0] == pytest.approx(LENGTH)

    def test_a_blow_at_the_corner_turns_both_cars_the_same_way(self) -> None:
        pair = resting_pair()
        pair["x"], pair["y"] = [0.0, LENGTH - 0.05], [0.0, 0.8 * WIDTH]
        pair["world_velocity_x"] = [50.0, 40.0]
        touch(pair)
        # The rear car is held back at its left, the front car pushed on at its right.
        assert (pair["yaw_rate"] > 0.1).all()

    @pytest.mark.parametrize("ahead", [1, -1])
    def test_cars_of_two_sizes_touch_where_their_boxes_meet(self, ahead: int) -> None:
        pair, small = resting_pair(), P._replace(half_length=1.0, half_width=0.5)
        for apart, touching in ((0.01, False), (-0.01, True)):
            pair["x"], pair["y"] = [0.0, ahead * (P.half_length + 1.0 + apart)], 0.0
            assert (Touch(*collide(pair[0], pair[1], DYNAMICS_DT, P, small)).closing >= 0.0) == touching
            pair["x"], pair["y"] = 0.0, [0.0, ahead * (P.half_width + 0.5 + apart)]
            assert (Touch(*collide(pair[0], pair[1], DYNAMICS_DT, P, small)).closing >= 0.0) == touching

    def test_cars_apart_do_not_touch(self) -> None:
        pair = resting_pair()
        pair["x"], pair["world_velocity_x"] = [0.0, LENGTH + 0.01], [50.0, 0.0]
        untouched = pair.copy()
        assert touch(pair).closing == -1.0
        assert (pair == untouched).all()

    @settings(max_examples=300, deadline=None)
    @given(
        st.sampled_from([90.0, 180.0]),
        number(-0.999, 0.999),
        number(0.001, 0.999),
        number(-math.pi, math.pi),
    )
    def test_head_on_hits_end_on_whatever_the_overlap(
        self, closing: float, beside: float, share: float, yaw: float
    ) -> None:
        pair = resting_pair()
        # Within the last step the noses met and went through each other for a share of that step.
        ahead, aside = LENGTH - share * closing * DYNAMICS_DT, beside * WIDTH
        pair["yaw"] = [yaw, yaw + math.pi]
        pair["x"] = [0.0, ahead * math.cos(yaw) - aside * math.sin(yaw)]
        pair["y"] = [0.0, ahead * math.sin(yaw) + aside * math.cos(yaw)]
        face(pair)
        for name, direction in (("world_velocity_x", "cos_yaw"), ("world_velocity_y", "sin_yaw")):
            pair[name] = closing / 2 * pair[direction]
        hit = touch(pair)
        assert hit.closing == pytest.approx(closing)
        assert hit.normal_x * math.cos(yaw) + hit.normal_y * math.sin(yaw) == pytest.approx(1.0)
        along = (pair["x"][1] - pair["x"][0]) * math.cos(yaw) + (pair["y"][1] - pair["y"][0]) * math.sin(yaw)
        assert along == pytest.approx(LENGTH)

    @pytest.mark.parametrize("closing", [90.0, 180.0])
    @pytest.mark.parametrize("turned", [0.0, math.pi / 2])
    def test_nothing_tunnels(self, closing: float, turned: float) -> None:
        # Head-on, and side on side, where a step at 180 m/s takes the cars through more than a half.
        track = stadium()
        for beside in (0.0, 0.5, -0.95):
            for shift in np.linspace(0.0, closing * DYNAMICS_DT, 8):
                world = world_with(
                    track, [100.0, 107.0 + shift], [0.0, beside * (WIDTH if turned == 0.0 else LENGTH)]
                )
                pair = world.state[0]
                pair["yaw"] = [turned, turned + math.pi]
                pair["world_velocity_x"] = [closing / 2, -closing / 2]
                pair["velocity_x"] = pair["world_velocity_x"] * np.cos(pair["yaw"])
                pair["velocity_y"] = -pair["world_velocity_x"] * np.sin(pair["yaw"])
                face(pair)
                while not world.contact_count[0]:
                    world.step(np.zeros((1, 2, 2)), 1)
                contact = world.new_contacts(0)[0]
                assert contact["closing"] == pytest.approx(closing, rel=0.03)
                assert pair["x"][0] < contact["x"] < pair["x"][1]
                # They part, or turn about each other, but neither goes on with half its speed.
                if beside == 0.0:
                    assert np.abs(pair["world_velocity_x"]).max() <= CAR_RESTITUTION * closing / 2

    def test_wall_at_ninety_metres_a_second(self) -> None:
        world = world_with(stadium(), [1000.0], speed=90.0, heading=math.pi / 2)
        car = world.state[0, 0]
        while not car["wall_contact"]:
            before = float(car["velocity_x"])
            world.step(np.zeros((1, 1, 2)), 1)
            assert car["y"] < 40.0
        # The nose hits at one of its corners, which begins a turn: what is left is at most what a
        # square blow on the corner leaves.
        lever = WIDTH / 2
        give = 1.0 / MASS + lever**2 / INERTIA
        left = before * (1.0 - (1.0 + WALL_RESTITUTION) / (MASS * give))
        assert car["world_velocity_y"] == pytest.approx(left, rel=0.02)
        for _ in range(30):
            world.step(np.zeros((1, 1, 2)), 1)
            nose = [
                car["y"] + LENGTH / 2 * math.sin(car["yaw"]) + side * WIDTH / 2 * math.cos(car["yaw"])
                for side in (1, -1)
            ]
            assert max(nose) < 40.0 + 0.7
        assert max(nose) < 40.05


class TestPile:
    @pytest.mark.parametrize("wall", [8.0, 40.0])
    @pytest.mark.parametrize("seed", [1, 2])
    def test_twenty_cars_come_to_rest_and_let_go(self, wall: float, seed: int) -> None:
        rng, count = np.random.default_rng(seed), 20
        world = world_with(
            stadium(wall - 1.0, wall),
            (300.0 - 5.0 * np.arange(count)).tolist(),
            lateral=rng.uniform(-3.0, 3.0, count).tolist(),
            speed=rng.uniform(0.0, 70.0, count).tolist(),
            heading=rng.uniform(-0.5, 0.5, count).tolist(),
        )
        pile = drive(world, -1.0, 0.3, seconds=14.0)[0]
        assert (pile["contacts"] > 0).sum() > 10
        assert np.hypot(pile["velocity_x"], pile["velocity_y"]).max() < 0.05
        assert np.abs(pile["yaw_rate"]).max() < 0.05
        assert deepest_overlap(pile) < 0.02

    def test_a_heap_comes_apart_without_being_flung(self) -> None:
        # Twenty cars where there is room for few: they are moved apart, not shot away.
        rng, count = np.random.default_rng(3), 20
        world = world_with(
            stadium(),
            rng.uniform(296.0, 304.0, count).tolist(),
            lateral=rng.uniform(-4.0, 4.0, count).tolist(),
            heading=rng.uniform(-3.0, 3.0, count).tolist(),
        )
        assert deepest_overlap(world.state[0]) > 1.0
        fastest = 0.0
        for _ in range(40):
            heap = drive(world, -1.0)[0]
            fastest = max(fastest, float(np.hypot(heap["velocity_x"], heap["velocity_y"]).max()))
        assert fastest < 0.5
        assert deepest_overlap(heap) < 0.02

    def test_a_crowd_pushing_into_a_wall_does_not_sink_in(self) -> None:
        count = 20
        world = world_with(
            stadium(7.0, 8.0),
            (300.0 - 5.5 * (np.arange(count) // 2)).tolist(),
            lateral=[1.5, -1.5] * (count // 2),
            heading=0.4,
        )
        crowd = drive(world, 0.6, seconds=6.0)[0]
        assert deepest_overlap(crowd) < 0.3
        assert np.abs(crowd["lateral"]).max() < 8.0


def test_walls_hold_at_any_speed_and_angle() -> None:
    track, rng, races = circle(60.0), np.random.default_rng(1), 24
    world = World(track, GT3, races, 1)
    for race in range(races):
        where, speed, heading = rng.uniform((0.0, 20.0, -1.5), (track.length, 90.0, 1.5))
        world.reset(race, start_at([where], 0.0, float(speed), float(heading)))
    furthest = -np.inf
    for _ in range(120):
        world.step(rng.uniform((0.0, -1.0), (1.0, 1.0), (races, 1, 2)))
        field = world.state[:, 0]
        cos, sin = np.cos(field["yaw"]), np.sin(field["yaw"])
        for along, across in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            x = field["x"] + along * LENGTH / 2 * cos - across * WIDTH / 2 * sin
            y = field["y"] + along * LENGTH / 2 * sin + across * WIDTH / 2 * cos
            nearest = np.hypot(track.table[:, [X]] - x, track.table[:, [Y]] - y).argmin(axis=0)
            row = track.table[nearest]
            left = (y - row[:, Y]) * row[:, TANGENT_X] - (x - row[:, X]) * row[:, TANGENT_Y]
            beyond = np.maximum(left - row[:, WALL_LEFT], -row[:, WALL_RIGHT] - left)
            furthest = max(furthest, float(beyond.max()))
    assert world.state["wall_contact"].any()
    # Only the deepest corner is pushed back at once: a second one may lag by a few substeps.
    assert furthest < 0.3
