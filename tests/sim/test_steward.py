"""Stewards: which contacts are whose fault, what leaving the course costs, how penalties are served."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from nathlon.sim.clock import DYNAMICS_DT
from nathlon.sim.physics.contact import Touch
from nathlon.sim.physics.course import course_parameters
from nathlon.sim.rules import RuleParameters, load_rules, rule_parameters
from nathlon.sim.state import CAR_STATE, OTHER, REAR_END, SIDE_SWIPE
from nathlon.sim.steward import judge, watch_limits
from nathlon.sim.track import Track
from nathlon.sim.world import World
from tests.support.driving import GT3, circle, road, start_at, world_with

SPORTING = load_rules("sporting")
RULES = rule_parameters(SPORTING)
LENGTH, WIDTH = GT3.body.length_m, GT3.body.width_m
STRAIGHT = 2000.0
COURSE = course_parameters(circle(100.0))


def avenue(half_width: float = 8.0, wall: float = 20.0, bump: float = 0.0, **facts: Any) -> Track:
    """Two straights and two half circles of 100 m radius, driven anticlockwise from (0, 0), east first.

    With a bump, the first straight goes so many metres aside (+ is left) and back from 1000 to 1120 m.
    """
    along = np.arange(0.0, STRAIGHT, 5.0)
    angle = np.arange(0.0, np.pi, 5.0 / 100.0)
    share = np.clip((along - 1000.0) / 120.0, 0.0, 1.0)
    aside = bump / 2 * (1.0 - np.cos(2 * np.pi * share))
    x = [along, STRAIGHT + 100 * np.sin(angle), STRAIGHT - along, -100 * np.sin(angle)]
    y = [aside, 100 - 100 * np.cos(angle), 0 * along + 200, 100 + 100 * np.cos(angle)]
    return road(np.concatenate(x), np.concatenate(y), half_width, wall, **facts)


def sporting_world(track: Track, distance: list[float], rules: str = "sporting", **start: Any) -> World:
    world = World(track, GT3, 1, len(distance), rules=load_rules(rules))
    world.reset(0, start_at(distance, **start))
    return world


def first_contact(world: World, throttle: float = 0.2) -> np.void:
    """Drive on until the first contact."""
    for _ in range(600):
        world.step(np.full((1, world.state.shape[1], 2), [throttle, 0.0]), 1)
        if world.contact_count[0]:
            return world.new_contacts(0)[0]
    raise AssertionError("no contact")


class TestContacts:
    @pytest.mark.parametrize(
        ("faster_by", "seconds"),
        [(0.7, 0.0), (3.0, SPORTING.contact.rear_end_s), (10.0, 2 * SPORTING.contact.rear_end_s)],
    )
    @pytest.mark.parametrize("order", [1, -1])
    def test_running_into_the_one_in_front(self, faster_by: float, seconds: float, order: int) -> None:
        places = [100.0, 100.0 + LENGTH + 0.1]
        world = sporting_world(avenue(), places[::order], speed=[30.0 + faster_by, 30.0][::order])
        guilty = 0 if order == 1 else 1
        contact = first_contact(world)
        assert contact["geometry"] == REAR_END
        assert contact["faster"] == contact["behind"] == guilty
        assert contact["fault"] == (guilty if seconds else -1)
        assert contact["penalty_s"] == seconds
        cars = world.state[0]
        assert cars["penalty_s"][guilty] == seconds
        assert cars["penalty_s"][1 - guilty] == 0.0
        assert cars["penalties"][guilty] == cars["contacts_at_fault"][guilty] == (seconds > 0.0)

    @pytest.mark.parametrize("side", [1.0, -1.0])
    @pytest.mark.parametrize("mover_ahead", [0.6, -0.6])
    @pytest.mark.parametrize("heading", [0.0, 0.4])
    def test_moving_over_into_the_one_beside(self, side: float, mover_ahead: float, heading: float) -> None:
        # The mover comes across at 2 m/s from the left (+) or the right of a car that goes straight.
        track = avenue() if heading == 0.0 else circle(200.0, 12.0, 20.0)
        world = sporting_world(
            track,
            [100.0, 100.0 + mover_ahead],
            lateral=[0.0, side * (WIDTH + 0.35)],
            speed=30.0,
            heading=[0.0, -side * 2.0 / 30.0],
        )
        contact = first_contact(world)
        assert contact["geometry"] == SIDE_SWIPE
        assert contact["fault"] == 1
        assert contact["penalty_s"] == SPORTING.contact.side_swipe_s
        assert world.state[0]["penalty_s"].tolist() == [0.0, SPORTING.contact.side_swipe_s]

    def test_coming_together_from_both_sides_is_nobodys_fault(self) -> None:
        world = sporting_world(
            avenue(), [100.0, 100.5], lateral=[1.2, -1.2], speed=30.0, heading=[-0.05, 0.05]
        )
        contact = first_contact(world)
        assert (contact["geometry"], contact["fault"], contact["penalty_s"]) == (SIDE_SWIPE, -1, 0.0)
        assert world.state["contacts"].tolist() == [[1, 1]]

    @pytest.mark.parametrize("heading", [np.pi, np.pi / 2, -np.pi / 2, 2.5])
    def test_hitting_a_car_that_stands_across_or_comes_the_other_way_is_other(self, heading: float) -> None:
        world = sporting_world(
            avenue(), [100.0, 108.0], lateral=[0.0, 0.5], speed=[40.0, 0.0], heading=[0.0, heading]
        )
        contact = first_contact(world)
        assert (contact["geometry"], contact["fault"]) == (OTHER, -1)
        assert (contact["behind"], contact["ahead"], contact["faster"]) == (0, 1, 0)
        assert world.state["penalty_s"].tolist() == [[0.0, 0.0]]

    def test_a_small_overlap_at_the_corner_is_still_a_hit_from_behind(self) -> None:
        world = sporting_world(avenue(), [100.0, 105.0], lateral=[0.0, 0.97 * WIDTH], speed=[60.0, 20.0])
        contact = first_contact(world)
        assert (contact["geometry"], contact["fault"]) == (REAR_END, 0)

    def test_faster_is_the_speed_whichever_way_a_car_points(self) -> None:
        # The car ahead slides sideways and is the faster one; the car behind is not at fault.
        world = world_with(avenue(), [106.0, 100.0], speed=[10.0, 0.0], heading=[0.0, np.pi / 2])
        slider = world.state[0, 1]
        slider["world_velocity_x"], slider["world_velocity_y"] = 30.0, 0.0
        slider["velocity_x"], slider["velocity_y"] = 0.0, -30.0
        contact = first_contact(world, 0.0)
        assert contact["faster"] == contact["behind"] == 1

    @pytest.mark.parametrize("bend", [1.0, -1.0])
    @pytest.mark.parametrize("drift", [0.0, 1.5, -1.5])
    def test_following_a_tight_bend_is_not_moving_over(self, bend: float, drift: float) -> None:
        # Two cars side by side, 3 m apart along a bend of 30 m radius, both on the line of the road
        # but for the drift of the first towards the second; the circle run backwards bends right.
        angle = bend * np.linspace(0.0, 2 * np.pi, 360, endpoint=False)
        track = road(30 * np.cos(angle), 30 * np.sin(angle), 8.0, 15.0)
        world = world_with(
            track, [101.0, 104.0], lateral=[-1.0, 1.0], speed=20.0, heading=[math.atan2(drift, 20.0), 0.0]
        )
        behind, ahead = world.state[0]
        hit = Touch(
            closing=1.5, x=0.0, y=0.0, normal_x=-float(ahead["sin_yaw"]), normal_y=float(ahead["cos_yaw"])
        )
        fault = -1 if drift == 0.0 else 0 if drift > 0.0 else 1
        assert judge(behind, ahead, hit, course_parameters(track), RULES) == (SIDE_SWIPE, fault)

    def test_sections_are_those_of_each_car(self) -> None:
        track = avenue(
            section=(
                {"name": "Allee", "kind": "straight", "start_m": 0.0, "end_m": 299.0},
                {"name": "Bogen", "kind": "corner", "start_m": 299.0, "end_m": 500.0},
            )
        )
        contact = first_contact(sporting_world(track, [300.0 - LENGTH, 300.5], speed=[40.0, 25.0]))
        assert (contact["section_behind"], contact["section_ahead"]) == (0, 1)
        contact = first_contact(sporting_world(track, [600.0, 600.5 + LENGTH], speed=[40.0, 30.0]))
        assert (contact["section_behind"], contact["section_ahead"]) == (-1, -1)

    def test_free_rules_note_the_fault_and_give_nothing(self) -> None:
        world = sporting_world(avenue(), [100.0, 106.0], rules="free", speed=[40.0, 30.0])
        contact = first_contact(world)
        assert (contact["fault"], contact["penalty_s"]) == (0, 0.0)
        assert world.state["contacts_at_fault"].tolist() == [[1, 0]]
        assert world.state["penalties"].tolist() == [[0, 0]]


def new_car() -> NDArray[np.void]:
    car = np.zeros(1, CAR_STATE)
    car["contact_s"] = -np.inf
    return car


def excursion(
    car: NDArray[np.void],
    seconds: float,
    saved: float = 0.0,
    began: float = 100.0,
    rules: RuleParameters = RULES,
) -> None:
    """Take a car at 40 m/s off course for some time, on a way by so many metres shorter than the road."""
    steps = round(seconds / DYNAMICS_DT)
    way = 40.0 * DYNAMICS_DT
    car["velocity_x"] = car["world_velocity_x"] = 40.0
    for step in range(steps + 1):
        watch_limits(car[0], step < steps, began + step * DYNAMICS_DT, DYNAMICS_DT, rules)
        car["progress"] += way + saved / steps


class TestLimits:
    def test_after_three_warnings_each_excursion_costs(self) -> None:
        car = new_car()
        for count in range(1, 7):
            excursion(car, 0.5, began=100.0 * count)
            assert car["warnings"] == count
            assert car["penalty_s"] == max(count - SPORTING.limits.warnings, 0) * SPORTING.limits.penalty_s
        assert car["penalties"] == 3

    @pytest.mark.parametrize(("seconds", "warnings"), [(0.2, 0), (0.4, 1)])
    def test_a_short_one_is_none(self, seconds: float, warnings: int) -> None:
        car = new_car()
        excursion(car, seconds)
        assert car["warnings"] == warnings

    @pytest.mark.parametrize(("touched", "warnings"), [(99.0, 0), (97.5, 0), (96.5, 1), (100.3, 1)])
    def test_one_that_begins_soon_after_a_touch_is_excused(self, touched: float, warnings: int) -> None:
        # It begins at 100 s. A touch while already off course, at 100.3 s, is no excuse.
        car = new_car()
        if touched < 100.0:
            car["contact_s"] = touched
        for step in range(61):
            now = 100.0 + step * DYNAMICS_DT
            if touched <= now:
                car["contact_s"] = touched
            watch_limits(car[0], step < 60, now, DYNAMICS_DT, RULES)
        assert car["warnings"] == warnings
        excursion(car, 0.5, began=200.0)
        assert car["warnings"] == warnings + 1

    @given(st.floats(-20.0, 20.0), st.floats(0.5, 4.0))
    @settings(deadline=None, max_examples=60)
    def test_saving_way_is_a_cut_and_losing_it_a_warning(self, saved: float, seconds: float) -> None:
        car = new_car()
        excursion(car, seconds, saved)
        if abs(saved - SPORTING.cutting.gain_m) < 0.2:
            return
        cut = saved > SPORTING.cutting.gain_m
        assert car["penalty_s"] == (SPORTING.cutting.penalty_s if cut else 0.0)
        assert car["warnings"] == (not cut)

    @pytest.mark.parametrize("bump", [20.0, -20.0])
    @pytest.mark.parametrize("place", [0.0, 0.8])
    def test_straight_across_a_chicane_is_a_cut(self, bump: float, place: float) -> None:
        # 120 m of road lead 20 m aside and back: straight across they are about 8 m shorter. The road
        # is left on the outside of the first of its bends, the way across lies inside the second.
        track = avenue(half_width=6.0, wall=28.0, bump=bump, runoff="tarmac")
        world = sporting_world(track, [980.0], lateral=math.copysign(place, bump), speed=40.0)
        for _ in range(50):
            world.step(np.full((1, 1, 2), [0.3, 0.0]))
        car = world.state[0, 0]
        assert not car["wall_contact"]
        assert car["off_course_s"] > 0.5
        assert not car["off_course"]
        assert (car["penalties"], car["penalty_s"]) == (1, SPORTING.cutting.penalty_s)
        assert car["warnings"] == 0

    @pytest.mark.parametrize("bend", [1.0, -1.0])
    def test_running_wide_at_the_exit_is_a_warning_and_no_cut(self, bend: float) -> None:
        angle = bend * np.linspace(0.0, 2 * np.pi, 360, endpoint=False)
        track = road(100 * np.cos(angle), 100 * np.sin(angle), 6.0, 30.0, runoff="tarmac")
        world = sporting_world(track, [10.0], lateral=-bend * 5.0, speed=20.0, heading=-bend * 0.3)
        for _ in range(80):
            car = world.state[0, 0]
            back = 2.7 / 100.0 * bend - 0.01 * (car["lateral"] + bend * 2.0) - 0.25 * car["heading_error"]
            world.step(np.array([[[0.1, back / GT3.steering.full_lock_rad]]]))
        assert car["off_course_s"] > 0.5
        assert not car["off_course"]
        assert (car["warnings"], car["penalties"]) == (1, 0)

    def test_free_rules_never_penalise(self) -> None:
        car = new_car()
        rules = rule_parameters(load_rules("free"))
        for count in range(1, 9):
            excursion(car, 0.5, saved=10.0 * (count % 2), began=100.0 * count, rules=rules)
        assert car["penalty_s"] == car["penalties"] == 0


ZONE = (1000.0, 1400.0)


def to_serve(seconds: float, start: float, speed: float, throttle: float, drive_s: float) -> NDArray[np.void]:
    """States after each dynamics step of a car with a penalty, (steps,)."""
    track = avenue(penalty_zone=({"start_m": ZONE[0], "end_m": ZONE[1]},))
    world = sporting_world(track, [start], speed=speed)
    world.state["penalty_s"] = seconds
    seen = []
    for _ in range(round(drive_s / DYNAMICS_DT)):
        world.step(np.full((1, 1, 2), [throttle, 0.0]), 1)
        seen.append(world.state[0, 0].copy())
    return np.array(seen)


class TestServing:
    @pytest.mark.parametrize("throttle", [1.0, 0.3])
    def test_full_throttle_is_held_to_100_km_per_hour_until_it_is_served(self, throttle: float) -> None:
        seen = to_serve(3.0, 900.0, 60.0, throttle, 14.0)
        speed, left, place = seen["velocity_x"], seen["penalty_s"], seen["progress"]
        inside = (place > ZONE[0] + 2.0) & (place < ZONE[1] - 2.0)
        limit = SPORTING.serving.speed_m_s
        # Nothing counts before the zone, nor while it slows down.
        assert (left[place < ZONE[0]] == 3.0).all()
        assert (left[(speed > limit + 1.1) & (left > 0.0)] == 3.0).all()
        serving = inside & (left < 3.0) & (left > 0.0)
        assert serving.sum() == pytest.approx(3.0 / DYNAMICS_DT, abs=2)
        assert speed[serving].max() < limit + 1.1
        assert speed[serving].min() > limit - 2.0
        # It is free to go once served.
        assert left[-1] == 0.0
        assert speed[-1] > limit + 2.0

    def test_what_the_zone_is_too_short_for_is_left(self) -> None:
        seen = to_serve(20.0, 995.0, 27.0, 1.0, 18.0)
        left = seen["penalty_s"][-1]
        # 400 m at just under 27.78 m/s, from the first second on.
        assert 20.0 - left == pytest.approx(400.0 / 27.5, abs=0.5)
        after = seen["progress"] > ZONE[1] + 2.0
        assert after.any()
        assert (seen["penalty_s"][after] == left).all()
        assert seen["velocity_x"][-1] > 30.0

    def test_a_slow_car_serves_at_its_own_pace(self) -> None:
        seen = to_serve(5.0, 1100.0, 15.0, 0.0, 4.0)
        assert seen["penalty_s"][-1] == pytest.approx(1.0, abs=1e-6)

    def test_without_a_penalty_the_zone_is_a_road_like_any_other(self) -> None:
        assert to_serve(0.0, 990.0, 60.0, 1.0, 2.0)["velocity_x"].min() > 59.0

    def test_a_penalty_that_is_not_served_is_added_at_the_finish(self) -> None:
        times = []
        for penalty in (0.0, 4.0):
            world = sporting_world(avenue(), [100.0], speed=50.0, finish=150.0)
            world.state["penalty_s"] = penalty
            while world.state["driving"].any():
                world.step(np.full((1, 1, 2), [0.5, 0.0]))
            times.append(float(world.state[0, 0]["finish_s"]))
        assert times[1] - times[0] == pytest.approx(4.0, abs=1e-12)
