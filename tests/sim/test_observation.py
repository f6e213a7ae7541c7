"""Observations: the description, and each part of the vector against the state it shows."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from nathlon.sim.car_facts import FACTS
from nathlon.sim.conditions import Conditions
from nathlon.sim.errors import InputError
from nathlon.sim.observation import (
    ANY_CAR,
    ERRORS,
    OPPONENT,
    OPPONENT_SIZE,
    PLANNED,
    STATION_SIZE,
    STATIONS_S,
    VERSION,
    ObservationSpec,
)
from nathlon.sim.plan import COLUMNS, CURVATURE, DIRECTION, OFFSET, SPEED, STEERING, Plan, X, Y
from nathlon.sim.track import Track
from nathlon.sim.world import World
from tests.support.driving import GT3, circle, drive, road, stadium, world_with

specs = st.builds(
    ObservationSpec,
    course_points=st.integers(0, 200),
    horizon_s=st.floats(0.5, 60.0),
    cars_ahead=st.integers(0, 10),
    cars_behind=st.integers(0, 10),
)


def raw(world: World, spec: ObservationSpec, car: int = 0) -> dict[str, NDArray[np.float64]]:
    """What one car of the first race sees, by field, before standardisation."""
    mean, deviation = spec.scaling
    vector = world.observe(spec, np.array([0]), np.array([car]))[0].astype(np.float64) * deviation + mean
    return {field.name: vector[spec.slice(field.name)] for field in spec.fields}


def seen(values: NDArray[np.float64]) -> list[dict[str, float]]:
    """The opponents of a list who are present."""
    rows = values.reshape(-1, OPPONENT_SIZE)
    opponents = [dict(zip((name for name, _, _ in OPPONENT), row, strict=True)) for row in rows]
    return [opponent for opponent in opponents if opponent["present"] > 0.5]


class TestSpec:
    @given(specs)
    def test_survives_the_way_through_json(self, spec: ObservationSpec) -> None:
        assert ObservationSpec.from_dict(json.loads(json.dumps(spec.to_dict()))) == spec

    @given(specs)
    def test_fields_tile_the_vector(self, spec: ObservationSpec) -> None:
        slices = [spec.slice(field.name) for field in spec.fields]
        assert slices[0].start == 0
        assert all(a.stop == b.start for a, b in pairwise(slices))
        assert slices[-1].stop == spec.size
        # 31 numbers of its own, three lines of points in space, seven numbers an opponent.
        assert spec.size == 31 + 9 * spec.course_points + 7 * (spec.cars_ahead + spec.cars_behind)

    def test_sizes_that_checkpoints_rely_on(self) -> None:
        assert ObservationSpec(course_points=16).size == 31 + 144 + 56 == 231
        assert ObservationSpec(course_points=60).size == 31 + 540 + 56 == 627

    @given(specs)
    def test_describes_every_field(self, spec: ObservationSpec) -> None:
        lines = spec.describe().splitlines()
        assert lines[0] == f"observation spec, version {VERSION}, {spec.size} numbers"
        assert [line.split()[1] for line in lines[1:]] == [field.name for field in spec.fields]
        assert all(f":{spec.slice(line.split()[1]).stop} " in line for line in lines[1:])

    def test_standardises_an_even_spread_to_mean_zero_and_deviation_one(self) -> None:
        spec = ObservationSpec(course_points=4)
        mean, deviation = spec.scaling
        low = np.concatenate([field.low for field in spec.fields])
        high = np.concatenate([field.high for field in spec.fields])
        even = low + (np.arange(1000)[:, None] + 0.5) / 1000 * (high - low)
        scaled = (even - mean) / deviation
        np.testing.assert_allclose(scaled.mean(axis=0), 0.0, atol=1e-4)
        np.testing.assert_allclose(scaled.std(axis=0), 1.0, rtol=1e-4)

    def test_the_layout_for_any_car_ends_with_the_car_and_names_no_place_of_a_circuit(self) -> None:
        spec = ObservationSpec(course_points=5, version=ANY_CAR)
        names = [field.name for field in spec.fields]
        assert names[-1] == "car"
        assert spec.facts == spec.fields[-1].size == len(FACTS)
        assert spec.size == ObservationSpec(course_points=5).size + spec.facts
        assert "progress" not in names
        assert spec.slice("axle_slip") == ObservationSpec(course_points=5).slice("progress")
        assert ObservationSpec.from_dict(spec.to_dict()) == spec

    def test_the_layout_with_a_plan_adds_it_before_the_car_and_cards_without_one_stay_as_they_were(
        self,
    ) -> None:
        spec, without = (ObservationSpec(course_points=5, version=version) for version in (PLANNED, ANY_CAR))
        assert [field.name for field in spec.fields][-2:] == ["plan", "car"]
        assert spec.size == without.size + STATION_SIZE * len(STATIONS_S) + ERRORS
        assert spec.facts == without.facts
        assert "plan_pace" not in without.to_dict()
        assert ObservationSpec.from_dict(spec.to_dict() | {"plan_pace": 0.9}).plan_pace == 0.9

    def test_walls_stand_beside_a_plan_and_cards_without_them_stay_as_they_were(self) -> None:
        spec, without = (ObservationSpec(version=PLANNED, walls=walls) for walls in (True, False))
        assert [field.name for field in spec.fields][-3:] == ["plan", "walls", "car"]
        assert spec.size == without.size + 2
        assert "walls" not in without.to_dict()
        assert ObservationSpec.from_dict(json.loads(json.dumps(spec.to_dict()))) == spec

    def test_another_version_cannot_drive(self) -> None:
        data = ObservationSpec().to_dict() | {"version": PLANNED + 1}
        with pytest.raises(InputError, match="version is 5, this simulator makes versions 2, 3, 4"):
            ObservationSpec.from_dict(data)

    @pytest.mark.parametrize(
        ("change", "complaint"),
        [
            ({"course_points": -1}, "course_points is -1, expected a whole number from 0 to 500"),
            ({"course_points": 2.5}, "course_points is 2.5, expected a whole number"),
            ({"course_points": "60"}, "course_points is '60', expected a whole number"),
            ({"cars_ahead": -1}, "cars_ahead is -1, expected a whole number from 0"),
            ({"plan_pace": 0.9}, "plan_pace is given, expected version 4 beside it"),
            ({"version": PLANNED, "plan_pace": 2.0}, "plan_pace is 2.0, expected 0.5 to 1.5"),
            ({"version": PLANNED, "practised_by": "a"}, "unknown field 'practised_by'"),
            ({"walls": True}, "walls are given, expected version 4 beside them"),
            ({"version": PLANNED, "walls": 1}, "walls is 1, expected true or false"),
            ({"version": True}, "version is True, expected a number"),
            ({"horizon_s": 0.0}, "horizon_s is 0.0, expected 0 to 60 s"),
            ({"colour": "red"}, "unknown field 'colour'"),
        ],
    )
    def test_faulty_field_is_named(self, change: dict[str, object], complaint: str) -> None:
        with pytest.raises(InputError, match=complaint):
            ObservationSpec.from_dict(ObservationSpec().to_dict() | change)


class TestOwnCar:
    def test_shows_the_state(self) -> None:
        world = world_with(stadium(), [1000.0], lateral=2.0, speed=40.0)
        car = drive(world, 0.6, 0.2, seconds=0.7)[0, 0]
        see = raw(world, ObservationSpec())
        # float32 carries 7 digits of numbers up to 8000.
        for name, wanted in {
            "velocity": [car["velocity_x"], car["velocity_y"]],
            "yaw_rate": [car["yaw_rate"]],
            "acceleration": [car["acceleration_x"], car["acceleration_y"]],
            "slip_angle": car["slip_angle"],
            "heading_error": [car["heading_error"]],
            "steering": [car["steering"] / GT3.steering.full_lock_rad],
            "throttle": [0.6],
            "brake": [0.0],
            "slipstream": [0.0],
            "penalty": [0.0],
            "tyre_wear": [0.0] * 4,
            "fuel": [1.0],
        }.items():
            np.testing.assert_allclose(see[name], wanted, rtol=1e-5, atol=1e-5, err_msg=name)
        np.testing.assert_allclose(see["tyre_load"], car["load"], atol=0.01)
        angle = 2 * np.pi * car["progress"] / world.track.length
        np.testing.assert_allclose(see["progress"], [np.sin(angle), np.cos(angle)], atol=1e-6)

    def test_shows_wear_fuel_and_penalty(self) -> None:
        world = world_with(stadium(), [1000.0], speed=40.0, conditions=Conditions(None, 20.0, 20.0))
        car = drive(world, 0.8, 0.1, seconds=2.0)[0, 0]
        car["penalty_s"] = 3.5
        see = raw(world, ObservationSpec())
        assert (see["tyre_wear"] > 0.0).all()
        np.testing.assert_allclose(see["tyre_wear"], car["wear"], atol=1e-6)
        assert 0.5 < see["fuel"][0] < 1.0
        assert see["fuel"][0] == pytest.approx(car["fuel"] / world.parameters.car.fuel_capacity, abs=1e-6)
        assert see["penalty"] == pytest.approx(3.5)

    def test_flags_rise_where_they_should(self) -> None:
        world = world_with(stadium(), [1000.0, 1004.6], lateral=30.0, speed=[20.0, 10.0])
        drive(world, -0.5)
        see = raw(world, ObservationSpec())
        flags = ("off_course", "car_contact", "wall_contact")
        assert [round(float(see[name][0])) for name in flags] == [1, 1, 0]
        assert see["brake"] == pytest.approx(0.5)
        world = world_with(stadium(), [1000.0], lateral=39.2)
        drive(world, 0.0)
        assert raw(world, ObservationSpec())["wall_contact"] == pytest.approx(1.0)


def hilly() -> Track:
    """A circle of 150 m that rises by 8 m twice a lap, banked by up to 0.15 rad, 5 m to the edges."""
    angle = np.linspace(0.0, 2 * np.pi, 300, endpoint=False)
    return road(
        150 * np.cos(angle),
        150 * np.sin(angle),
        5.0,
        12.0,
        z=8 * np.sin(2 * angle),
        bank=0.15 * np.cos(angle),
    )


HILLY = hilly()


def surface(angle: NDArray[np.float64], lateral: float) -> NDArray[np.float64]:
    """Points of that road in the world's frame, exact, (..., 3)."""
    radius = 150.0 - lateral
    height = 8 * np.sin(2 * angle) + np.tan(0.15 * np.cos(angle)) * lateral
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)


class TestCourse:
    """A point is x of left, centre, right, then y, then z: (points, 3, 3) as axis, line."""

    @pytest.mark.parametrize("heading", [0.0, 0.3, -0.5])
    def test_points_on_a_straight(self, heading: float) -> None:
        spec = ObservationSpec(course_points=6, horizon_s=3.0)
        world = world_with(stadium(), [1000.0], lateral=3.0, speed=40.0, heading=heading)
        course = raw(world, spec)["course"].reshape(6, 3, 3)
        # On the straight the points are 0, 20, 40.. m ahead of the car's foot, 20 m to either side.
        x = np.arange(6) * 3.0 / 6 * 40.0
        for line, lateral in enumerate((20.0, 0.0, -20.0)):
            y = lateral - 3.0
            ahead = x * np.cos(heading) + y * np.sin(heading)
            aside = y * np.cos(heading) - x * np.sin(heading)
            np.testing.assert_allclose(course[:, 0, line], ahead, atol=2e-3)
            np.testing.assert_allclose(course[:, 1, line], aside, atol=2e-3)
        np.testing.assert_allclose(course[:, 2], 0.0, atol=1e-4)

    @given(st.floats(-500.0, 1500.0), st.floats(-6.0, 6.0), st.floats(-3.0, 3.0), st.floats(0.0, 60.0))
    @settings(deadline=None, max_examples=60)
    def test_points_on_a_hilly_banked_bend(
        self, distance: float, lateral: float, heading: float, speed: float
    ) -> None:
        spec = ObservationSpec(course_points=20, horizon_s=6.0)
        world = world_with(HILLY, [distance], lateral=lateral, speed=speed, heading=heading)
        course = raw(world, spec)["course"].reshape(20, 3, 3)
        # The car stands on the plane that touches the road under it: found here by differences.
        start, step = distance / 150.0, 1e-6
        foot = surface(np.array(start), lateral)
        along = (surface(np.array(start + step), lateral) - surface(np.array(start - step), lateral)) / 2
        across = (surface(np.array(start), lateral + step) - surface(np.array(start), lateral - step)) / 2
        rise = np.linalg.solve(np.stack([along[:2], across[:2]]), np.array([along[2], across[2]]))
        yaw = start + np.pi / 2 + heading
        forward, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
        angle = start + np.arange(20) / 20 * 6.0 * max(speed, 10.0) / 150.0
        for line, offset in enumerate((5.0, 0.0, -5.0)):
            seen = surface(angle, offset) - foot
            # Edges run straight between rows 2 m apart, 5 mm inside the arc, and heights likewise; the
            # foot lies on arcs, whose ends differ from the circle by a few millimetres more.
            np.testing.assert_allclose(course[:, 0, line], seen[:, :2] @ forward, atol=0.03)
            np.testing.assert_allclose(course[:, 1, line], seen[:, :2] @ left, atol=0.03)
            above = seen[:, 2] - seen[:, :2] @ rise
            np.testing.assert_allclose(course[:, 2, line], above, atol=0.05)

    def test_inclination_is_the_gradient_in_the_frame_of_the_car(self) -> None:
        # At the start the road rises by 16 m in 150 m, and its left side is up.
        climb, bank = 16 / 150, np.tan(0.15)
        for heading, wanted in ((0.0, (climb, bank)), (np.pi / 2, (bank, -climb)), (np.pi, (-climb, -bank))):
            see = raw(world_with(HILLY, [0.0], heading=heading), ObservationSpec())
            np.testing.assert_allclose(see["inclination"], wanted, atol=1e-3)

    def test_points_keep_their_spacing_at_rest_and_across_the_line(self) -> None:
        spec = ObservationSpec(course_points=5, horizon_s=5.0)
        track = stadium()
        world = world_with(track, [track.length - 3.0], heading=0.0)
        points = raw(world, spec)["course"].reshape(5, 3, 3)[:, :2, 1]
        steps = np.hypot(*np.diff(points, axis=0).T)
        # At rest the horizon is spanned at 10 m/s; the end of the half circle bends a chord by 1 mm.
        np.testing.assert_allclose(steps, 10.0, atol=0.01)

    def test_without_points_all_else_stays(self) -> None:
        world = world_with(stadium(), [1000.0, 1015.0], lateral=[0.0, 2.0], speed=[30.0, 20.0])
        many, none = (
            world.observe(ObservationSpec(course_points=n), np.array([0, 0]), np.array([0, 1]))
            for n in (60, 0)
        )
        np.testing.assert_array_equal(np.delete(many, ObservationSpec().slice("course"), axis=1), none)


class TestOpponents:
    SPEC = ObservationSpec(course_points=1, cars_ahead=2, cars_behind=2)

    def test_nearest_come_first_ahead_and_behind(self) -> None:
        world = world_with(stadium(), [1000.0, 1030.0, 1010.0, 1020.0, 990.0, 975.0], speed=30.0)
        see = raw(world, self.SPEC)
        # Of three ahead the two nearest are seen; places are exact to the table's float32.
        assert [c["x"] for c in seen(see["cars_ahead"])] == pytest.approx([10.0, 20.0], abs=1e-3)
        assert [c["x"] for c in seen(see["cars_behind"])] == pytest.approx([-10.0, -25.0], abs=1e-3)

    def test_ahead_is_seen_further_than_behind(self) -> None:
        world = world_with(stadium(), [1000.0, 1079.0, 1081.0, 961.0, 959.0], speed=30.0)
        see = raw(world, self.SPEC)
        assert [c["x"] for c in seen(see["cars_ahead"])] == pytest.approx([79.0], abs=1e-3)
        assert [c["x"] for c in seen(see["cars_behind"])] == pytest.approx([-39.0], abs=1e-3)

    def test_absent_ones_are_the_standardised_zero(self) -> None:
        world = world_with(stadium(), [1000.0, 1010.0], speed=30.0)
        see = world.observe(self.SPEC, np.array([0]), np.array([0]))[0]
        mean, deviation = self.SPEC.scaling
        zero = -mean / deviation
        behind = self.SPEC.slice("cars_behind")
        np.testing.assert_allclose(see[behind], zero[behind], rtol=1e-6)
        second = slice(self.SPEC.slice("cars_ahead").start + OPPONENT_SIZE, behind.start)
        np.testing.assert_allclose(see[second], zero[second], rtol=1e-6)

    def test_motion_is_relative_in_the_frame_of_the_seeing_car(self) -> None:
        world = world_with(
            stadium(), [1000.0, 1015.0], lateral=[0.0, 4.0], speed=[30.0, 20.0], heading=[np.pi / 2, 0.0]
        )
        see = raw(world, self.SPEC)
        # The car looks left across the road, so the road ahead lies to its right.
        other = seen(see["cars_ahead"])[0]
        assert (other["x"], other["y"]) == pytest.approx((4.0, -15.0), abs=1e-3)
        assert (other["velocity_x"], other["velocity_y"]) == pytest.approx((-30.0, -20.0), abs=1e-3)

    def test_acceleration_is_relative_and_turned_too(self) -> None:
        world = world_with(stadium(), [1000.0, 1015.0], speed=[30.0, 30.0], heading=[0.0, np.pi / 2])
        state = world.state[0]
        state["acceleration_x"], state["acceleration_y"] = [2.0, 5.0], [1.0, 0.5]
        other = seen(raw(world, self.SPEC)["cars_ahead"])[0]
        # The other's forward is the seer's left, and its left the seer's rear.
        assert (other["acceleration_x"], other["acceleration_y"]) == pytest.approx((-2.5, 4.0), abs=1e-4)

    def test_lists_may_be_empty(self) -> None:
        spec = ObservationSpec(course_points=1, cars_ahead=0, cars_behind=0)
        world = world_with(stadium(), [1000.0, 1010.0])
        assert world.observe(spec, np.array([0, 0]), np.array([0, 1])).shape == (2, 40)


def round_the_circle(offset: float, speed: float) -> tuple[Track, Plan]:
    """A circle of 100 m, and the plan to drive round it at an offset."""
    track = circle(100.0)
    angle = np.arange(len(track.table)) * track.spacing / 100.0
    lap = np.zeros((len(angle), COLUMNS))
    radius = 100.0 - offset
    lap[:, X], lap[:, Y] = radius * np.cos(angle), radius * np.sin(angle)
    lap[:, OFFSET], lap[:, DIRECTION] = offset, angle + np.pi / 2
    lap[:, CURVATURE], lap[:, SPEED], lap[:, STEERING] = 1.0 / radius, speed, 0.1
    return track, Plan.of_lap(lap)


class TestPlan:
    SPEC = ObservationSpec(course_points=0, cars_ahead=0, cars_behind=0, version=PLANNED, plan_pace=0.9)

    @pytest.mark.parametrize("place", [30.0, -4.0])
    def test_shows_line_and_speeds_ahead_also_across_the_line(self, place: float) -> None:
        track, plan = round_the_circle(2.0, 40.0)
        world = world_with(track, [track.length + place], lateral=0.5, speed=20.0, heading=0.1)
        world.show(plan)
        see = raw(world, self.SPEC)["plan"]
        stations = see[:-ERRORS].reshape(len(STATIONS_S), STATION_SIZE)
        ahead = np.array(STATIONS_S) * 20.0 / 100.0  # as an angle of the circle
        np.testing.assert_allclose(stations[:, 0], 1.5, atol=2e-3)
        # From a car 99.5 m from the middle that is turned to the inside by 0.1.
        forward, inward = 98.0 * np.sin(ahead), 99.5 - 98.0 * np.cos(ahead)
        np.testing.assert_allclose(stations[:, 1], inward * np.cos(0.1) - forward * np.sin(0.1), atol=0.01)
        np.testing.assert_allclose(stations[:, 2], ahead - 0.1, atol=2e-3)
        np.testing.assert_allclose(stations[:, 3], (36.0 - 20.0) / 36.0, atol=1e-5)
        np.testing.assert_allclose(stations[:, 4], 1.0 / 98.0, atol=1e-5)
        np.testing.assert_allclose(stations[:, 5], 0.1, atol=1e-5)
        errors = np.array([1.5, -0.1, 16.0 / 36.0, 0.0, -20.0 / 98.0])
        fine = np.array([0.5, 0.05, 0.05, 0.05, 0.1])
        np.testing.assert_allclose(see[-ERRORS:], errors / (fine + np.abs(errors)), atol=2e-3)

    def test_a_car_that_is_told_a_pace_sees_other_speeds(self) -> None:
        track, plan = round_the_circle(2.0, 40.0)
        world = world_with(track, [30.0], speed=20.0)
        world.show(plan)
        before = raw(world, self.SPEC)["plan"]
        world.ask_pace(0, 0, 0.8)
        see = raw(world, self.SPEC)["plan"]
        target = 0.8 * 36.0
        stations = see[:-ERRORS].reshape(len(STATIONS_S), STATION_SIZE)
        np.testing.assert_allclose(stations[:, 3], (target - 20.0) / target, atol=1e-5)
        assert np.count_nonzero(see != before) == len(STATIONS_S) + 1

    def test_who_has_practised_sees_a_plan_of_their_own(self) -> None:
        track, plan = round_the_circle(2.0, 40.0)
        world = world_with(track, [30.0], speed=20.0)
        own = replace(self.SPEC, practised_by="a")
        world.show(plan)
        before = raw(world, self.SPEC)
        with pytest.raises(InputError, match="sees a plan, expected a world that has been shown one"):
            raw(world, own)
        world.show(round_the_circle(2.0, 45.0)[1], practised_by="a")
        targets = (
            raw(world, spec)["plan"][:-ERRORS].reshape(len(STATIONS_S), STATION_SIZE)[:, 3]
            for spec in (self.SPEC, own)
        )
        for target, speed in zip(targets, (36.0, 40.5), strict=True):
            np.testing.assert_allclose(target, (speed - 20.0) / speed, atol=1e-5)
        assert all(np.array_equal(raw(world, self.SPEC)[name], before[name]) for name in before)

    def test_worn_tyres_take_speed_from_a_practised_plan_alone(self) -> None:
        track, plan = round_the_circle(2.0, 40.0)
        world = world_with(track, [30.0], speed=20.0)
        own = replace(self.SPEC, practised_by="a")
        world.show(plan)
        world.show(plan, practised_by="a")
        world.state["wear"][:, :, 1] = 0.5  # of the tyre that is worn most
        for spec, target in ((self.SPEC, 36.0), (own, 36.0 * 0.99)):
            stations = raw(world, spec)["plan"][:-ERRORS].reshape(len(STATIONS_S), STATION_SIZE)
            np.testing.assert_allclose(stations[:, 3], (target - 20.0) / target, atol=1e-5)

    def test_all_else_is_that_of_the_layout_without_a_plan(self) -> None:
        track, plan = round_the_circle(2.0, 40.0)
        world = world_with(track, [30.0, 40.0], speed=20.0)
        world.show(plan)
        with_plan, without = (
            world.observe(ObservationSpec(version=version), np.array([0]), np.array([0]))[0]
            for version in (PLANNED, ANY_CAR)
        )
        rest = np.delete(with_plan, ObservationSpec(version=PLANNED).slice("plan"))
        assert rest.tobytes() == without.tobytes()

    @pytest.mark.parametrize("lateral", [0.0, 4.0, -9.0])
    def test_walls_are_as_far_as_the_car_has_room(self, lateral: float) -> None:
        track, plan = round_the_circle(2.0, 40.0)  # the walls are 15 m from the centre line
        world = world_with(track, [30.0], lateral=lateral)
        world.show(plan)
        room = np.array([15.0 - lateral, 15.0 + lateral])
        see = raw(world, replace(self.SPEC, walls=True))
        np.testing.assert_allclose(see["walls"], room / (5.0 + room), atol=1e-3)
        np.testing.assert_array_equal(see["plan"], raw(world, self.SPEC)["plan"])

    def test_a_row_does_not_depend_on_those_beside_it(self) -> None:
        track, plan = round_the_circle(2.0, 40.0)
        places = [10.0 * place for place in range(20)]
        world = world_with(track, places, speed=places)
        world.show(plan)
        cars = np.arange(20)
        together = world.observe(self.SPEC, 0 * cars, cars)
        alone = [world.observe(self.SPEC, np.array([0]), np.array([car]))[0] for car in cars]
        assert together.tobytes() == np.stack(alone).tobytes()

    def test_a_car_that_flies_off_sees_a_plan(self) -> None:
        track, plan = round_the_circle(2.0, 40.0)
        world = world_with(track, [30.0], speed=20.0)
        world.show(plan)
        for speed in (1e30, np.inf, np.nan):
            world.state["velocity_x"] = speed
            assert world.observe(self.SPEC, np.array([0]), np.array([0])).shape == (1, self.SPEC.size)

    def test_without_a_plan_it_is_said(self) -> None:
        world = world_with(circle(100.0), [30.0])
        with pytest.raises(InputError, match="observation version 4 sees a plan, expected a world"):
            world.observe(self.SPEC, np.array([0]), np.array([0]))
