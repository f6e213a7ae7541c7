"""Observations: the description, and each part of the vector against the state it shows."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sim.errors import InputError
from sim.observation import OPPONENT, VERSION, ObservationSpec
from sim.world import World
from tests.driving import GT3, drive, stadium, world_with

specs = st.builds(
    ObservationSpec,
    course_points=st.integers(1, 200),
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
    rows = values.reshape(-1, len(OPPONENT))
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
        # 23 numbers of its own, three lines of points, seven numbers an opponent.
        assert spec.size == 23 + 6 * spec.course_points + 7 * (spec.cars_ahead + spec.cars_behind)

    def test_sizes_that_checkpoints_rely_on(self) -> None:
        assert ObservationSpec(course_points=16).size == 175
        assert ObservationSpec(course_points=60).size == 439

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

    def test_another_version_cannot_drive(self) -> None:
        data = ObservationSpec().to_dict() | {"version": VERSION + 1}
        with pytest.raises(InputError, match=f"version is {VERSION + 1}, this simulator makes version"):
            ObservationSpec.from_dict(data)

    @pytest.mark.parametrize(
        ("change", "complaint"),
        [
            ({"course_points": 0}, "course_points is 0, expected a whole number from 1 to 500"),
            ({"course_points": 2.5}, "course_points is 2.5, expected a whole number"),
            ({"course_points": "60"}, "course_points is '60', expected a whole number"),
            ({"cars_ahead": -1}, "cars_ahead is -1, expected a whole number from 0"),
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
        }.items():
            np.testing.assert_allclose(see[name], wanted, rtol=1e-5, atol=1e-5, err_msg=name)
        np.testing.assert_allclose(see["tyre_load"], car["load"], atol=0.01)
        angle = 2 * np.pi * car["progress"] / world.track.length
        np.testing.assert_allclose(see["progress"], [np.sin(angle), np.cos(angle)], atol=1e-6)

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


class TestCourse:
    @pytest.mark.parametrize("heading", [0.0, 0.3, -0.5])
    def test_points_on_a_straight(self, heading: float) -> None:
        spec = ObservationSpec(course_points=6, horizon_s=3.0)
        world = world_with(stadium(), [1000.0], lateral=3.0, speed=40.0, heading=heading)
        see = raw(world, spec)
        # On the straight the points are 0, 20, 40.. m ahead of the car's foot, 20 m to either side.
        along = np.arange(6) * 3.0 / 6 * 40.0
        for line, lateral in (("left", 20.0), ("centre", 0.0), ("right", -20.0)):
            x, y = along, np.full(6, lateral - 3.0)
            wanted = np.stack(
                [x * np.cos(heading) + y * np.sin(heading), y * np.cos(heading) - x * np.sin(heading)]
            )
            points = see[f"course_{line}"].reshape(6, 2).T
            np.testing.assert_allclose(points, wanted, atol=2e-3)

    def test_points_keep_their_spacing_at_rest_and_across_the_line(self) -> None:
        spec = ObservationSpec(course_points=5, horizon_s=5.0)
        track = stadium()
        world = world_with(track, [track.length - 3.0], heading=0.0)
        points = raw(world, spec)["course_centre"].reshape(5, 2)
        steps = np.hypot(*np.diff(points, axis=0).T)
        # At rest the horizon is spanned at 10 m/s; the end of the half circle bends a chord by 1 mm.
        np.testing.assert_allclose(steps, 10.0, atol=0.01)


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
        second = slice(self.SPEC.slice("cars_ahead").start + len(OPPONENT), behind.start)
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
        assert world.observe(spec, np.array([0, 0]), np.array([0, 1])).shape == (2, 29)
