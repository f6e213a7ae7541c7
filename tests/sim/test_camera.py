"""Pictures: the same bytes always, places and sizes by closed forms, and nothing that a camera cannot see."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.sim.camera_spec import MOUNTS, CameraSpec
from nathlon.sim.errors import InputError
from nathlon.sim.observation import SEEING, SENSORS, ObservationSpec
from nathlon.sim.state import CarRecord
from nathlon.sim.track import Track, X, Y, Z, load_track
from nathlon.sim.track.crossing import bridge_heights, find_crossings
from nathlon.sim.world import World
from tests.support.driving import GT3, STRAIGHT_M, circle, drive, road, stadium, start_at, world_with

Picture = NDArray[np.uint8]
SPEC = ObservationSpec(camera=CameraSpec())
FINE = CameraSpec(width=256, height=256)
HAZE_RED, ZENITH_RED = 196, 70


def seen(world: World, spec: ObservationSpec = SPEC, car: int = 0, race: int = 0) -> NDArray[np.void]:
    """What one car sees and feels: a record."""
    return world.observe(spec, np.array([race]), np.array([car]))[0]


def picture(world: World, camera: CameraSpec = FINE, car: int = 0) -> Picture:
    """What the camera of a car of the first race sees."""
    return np.asarray(seen(world, ObservationSpec(camera=camera), car)["picture"])


@cache
def slope(gradient: float) -> Track:
    """The stadium on a plane that rises towards the end of its first straight."""
    flat = stadium().table[::5]
    return road(flat[:, X], flat[:, Y], 20.0, 40.0, z=gradient * flat[:, X])


@cache
def crest() -> Track:
    """A stadium with a hill of 8 m in the middle of each straight, some 120 m long."""
    flat = stadium(6.0, 9.0).table[::2]
    hill = 8.0 * np.exp(-(((flat[:, X] - STRAIGHT_M / 2) / 30.0) ** 2))
    return road(flat[:, X], flat[:, Y], 6.0, 9.0, z=hill)


@cache
def eight() -> Track:
    """A figure of eight with a bridge."""
    angle = np.linspace(0.0, 2.0 * np.pi, 600, endpoint=False) + 0.8
    line = np.stack([400.0 * np.sin(angle), 250.0 * np.sin(2.0 * angle)], axis=1)
    height = bridge_heights(find_crossings(line), len(line), 3.0)
    return road(line[:, 0], line[:, 1], 5.0, 7.0, z=height)


def horizon(sky: Picture) -> float:
    """At which height of a picture the sky at its left side would have the colour of the haze."""
    red, _, blue = np.moveaxis(sky[:, 2].astype(np.float64), -1, 0)
    above = np.arange(len(red)) < np.argmax(red)
    rows = np.flatnonzero(above & (blue > 200) & (red > ZENITH_RED + 4) & (red < HAZE_RED - 8))
    fall, start = np.polyfit(rows + 0.5, red[rows], 1)
    return float((HAZE_RED - start) / fall)


class TestSpec:
    def test_travels_through_json_and_is_no_part_of_one_without_a_camera(self) -> None:
        spec = ObservationSpec(camera=CameraSpec(width=96, mount="roof", noise=3.0))
        assert ObservationSpec.from_dict(json.loads(json.dumps(spec.to_dict()))) == spec
        assert "camera" not in ObservationSpec().to_dict()

    def test_has_numbers_of_sensors_and_none_that_name_a_place(self) -> None:
        assert SPEC.version == SEEING
        assert [field.name for field in SPEC.fields] == [field.name for field in SENSORS]
        assert SPEC.size == 16
        blank = SPEC.blank(3)
        assert blank["picture"].shape == (3, 64, 64, 3)
        assert blank["sensors"].shape == (3, 16)

    @pytest.mark.parametrize(
        ("make", "told"),
        [
            (lambda: CameraSpec(width=8), "camera: width is 8, expected a whole number from 16 to 256"),
            (
                lambda: CameraSpec(mount="wing"),
                "camera: mount is 'wing', expected one of cockpit, roof, chase",
            ),
            (lambda: CameraSpec(field_of_view=True), "camera: field_of_view is True, expected 20 to 140"),
            (lambda: CameraSpec(channels=4), "camera: channels is 4, expected 1 (grey) or 3 (colour)"),
            (
                lambda: ObservationSpec(course_points=20, camera=CameraSpec()),
                "observation spec: course_points is 20, expected 0 beside a camera",
            ),
            (lambda: ObservationSpec(version=SEEING), "observation spec: version is 5"),
            (lambda: ObservationSpec.from_dict({"camera": {"zoom": 2}}), "camera: unknown field 'zoom'"),
            (lambda: ObservationSpec.from_dict({"camera": 7}), "camera: is 7, expected an object"),
        ],
    )
    def test_refuses_what_is_no_camera(self, make: Callable[[], object], told: str) -> None:
        with pytest.raises(InputError) as raised:
            make()
        assert str(raised.value).startswith(told)


@pytest.fixture(name="field", scope="module")
def _field() -> World:
    """Three races of four cars somewhere on the Lindenring, all in motion."""
    world = World(load_track("lindenring"), GT3, 3, 4, threads=3)
    for race in range(3):
        start = start_at([200.0 * race + 9.0 * car for car in range(4)], [0.0, 2.0, -2.0, 1.0], 30.0)
        world.reset(race, start)
    drive(world, 0.7, 0.1, seconds=1.0)
    return world


class TestBytes:
    @pytest.mark.parametrize(
        "camera",
        [
            CameraSpec(),
            CameraSpec(width=48, height=40, mount="chase", channels=1, noise=12.0, blur=2, seed=5),
        ],
    )
    def test_are_the_same_in_any_batch_and_on_any_thread(self, field: World, camera: CameraSpec) -> None:
        spec = ObservationSpec(camera=camera)
        races, cars = np.repeat(np.arange(3), 4), np.tile(np.arange(4), 3)
        together = field.observe(spec, races, cars)
        backwards = field.observe(spec, races[::-1].copy(), cars[::-1].copy())[::-1]
        alone = World(field.track, GT3, 1, 4)
        assert len({one.tobytes() for one in together}) == 12
        for row, (race, car) in enumerate(zip(races, cars, strict=True)):
            alone.state[0], alone.ticks[0] = field.state[race], field.ticks[race]
            expected = seen(alone, spec, int(car)).tobytes()
            assert together[row].tobytes() == backwards[row].tobytes() == expected

    def test_noise_depends_on_seed_and_time_and_has_its_deviation(self, field: World) -> None:
        def noisy(seed: int) -> NDArray[np.float64]:
            camera = CameraSpec(width=128, height=128, noise=8.0, seed=seed)
            return picture(field, camera).astype(np.float64)

        clean = picture(field, CameraSpec(width=128, height=128)).astype(np.float64)
        apart = noisy(1) - clean
        inside = (clean > 40) & (clean < 215)
        assert apart[inside].mean() == pytest.approx(0.0, abs=0.2)
        assert apart[inside].std() == pytest.approx(8.0, rel=0.03)
        assert (noisy(1) == noisy(1)).all()
        assert (noisy(1) != noisy(2)).mean() > 0.8
        before = noisy(1)
        field.ticks += 1
        assert (noisy(1) != before).mean() > 0.8

    def test_blur_keeps_the_mean_and_softens_edges(self, field: World) -> None:
        sharp, soft = (picture(field, CameraSpec(blur=blur)).astype(np.float64) for blur in (0, 3))
        assert soft.mean() == pytest.approx(sharp.mean(), abs=3.0)
        assert np.abs(np.diff(soft, axis=1)).mean() < 0.6 * np.abs(np.diff(sharp, axis=1)).mean()

    def test_a_car_that_is_nowhere_sees_something(self) -> None:
        world = world_with(stadium(), [100.0, 120.0])
        for name in ("x", "y", "z", "cos_yaw", "slope_x"):
            world.state[name] = np.nan
        for mount in MOUNTS:
            assert picture(world, CameraSpec(mount=mount)).shape == (64, 64, 3)


class TestGeometry:
    @pytest.mark.parametrize("mount", MOUNTS)
    @pytest.mark.parametrize("gradient", [-0.06, 0.0, 0.08])
    def test_the_horizon_lies_where_pitch_and_slope_put_it(self, mount: str, gradient: float) -> None:
        camera = CameraSpec(width=64, height=256, mount=mount, vertical_field_of_view=60.0)
        world = world_with(slope(gradient), [STRAIGHT_M / 2])
        down = MOUNTS[mount].pitch - np.arctan(gradient)
        expected = 128.0 - camera.focal[1] * np.tan(down)
        assert horizon(picture(world, camera)) == pytest.approx(expected, abs=1.5)

    def test_a_banked_road_tilts_the_horizon(self) -> None:
        world = world_with(circle(500.0, bank=-0.1), [100.0])
        sky = picture(world, CameraSpec(width=256, height=256, field_of_view=60, vertical_field_of_view=60))
        land = sky[:, :, 2] < sky[:, :, 1]  # green, not blue
        left, right = (np.flatnonzero(land[:, column].any() & land[:, column])[0] for column in (20, 235))
        assert abs(left - right) == pytest.approx(0.1 * 215, abs=6.0)

    @pytest.mark.parametrize("lateral", [-4.0, 0.0, 7.0])
    @pytest.mark.parametrize("mount", ["cockpit", "roof"])
    def test_the_edge_of_the_road_is_where_its_points_project(self, mount: str, lateral: float) -> None:
        camera = CameraSpec(width=256, height=256, mount=mount, field_of_view=100.0)
        world = world_with(stadium(half_width=10.0), [STRAIGHT_M / 2], lateral)
        shot, (across, up), sits = picture(world, camera), camera.focal, MOUNTS[mount]
        sine, cosine = np.sin(sits.pitch), np.cos(sits.pitch)
        for row in (120, 135, 160):
            fall = (row + 0.5 - 128.0) / up  # a metre ahead
            ahead = sits.height * (cosine - fall * sine) / (sine + fall * cosine)
            depth = ahead * cosine + sits.height * sine
            for side in (-1.0, 1.0):
                column = 128.0 - across * (side * 10.0 - lateral) / depth
                if not 4 <= column < 252:
                    continue
                line = shot[row].astype(np.int64)
                grass = line[:, 1] - line[:, 2] > 25
                borders = np.flatnonzero(np.diff(grass.astype(np.int64))) + 1
                assert np.abs(borders - column).min() <= 1.5, (row, side, column, borders)

    @pytest.mark.parametrize("apart", [12.0, 20.0, 35.0])
    def test_a_car_ahead_is_as_wide_as_its_distance_says(self, apart: float) -> None:
        camera = CameraSpec(width=256, height=256, field_of_view=50.0)
        world = world_with(stadium(), [1000.0, 1000.0 + apart])
        with_car = picture(world, camera)
        world.state["driving"][0, 1] = False
        changed = (with_car != picture(world, camera)).any(axis=2)
        columns = np.flatnonzero(changed.any(axis=0))
        middle = (GT3.body.front_axle_m - GT3.body.rear_axle_m) / 2.0
        rear = apart + middle - GT3.body.length_m / 2.0 - MOUNTS["cockpit"].forward
        expected = camera.focal[0] * 1.06 * GT3.body.width_m / rear  # its shadow is a little wider
        assert columns[-1] - columns[0] + 1 == pytest.approx(expected, abs=2.5)

    def test_cars_beside_are_seen_on_their_side(self) -> None:
        world = world_with(stadium(), [1000.0, 1005.0], [0.0, 3.0])
        camera = CameraSpec(field_of_view=100.0)
        with_car = picture(world, camera)
        world.state["driving"][0, 1] = False
        changed = (with_car != picture(world, camera)).any(axis=(0, 2))
        assert changed[:32].sum() > 8
        assert not changed[36:].any()

    def test_grey_is_the_luminance_of_colour(self) -> None:
        world = world_with(load_track("lindenring"), [100.0, 115.0])
        colour, grey = (picture(world, CameraSpec(channels=channels)) for channels in (3, 1))
        np.testing.assert_allclose(grey[:, :, 0], colour @ np.array([0.299, 0.587, 0.114]), atol=1.5)

    def test_show_which_way_a_road_goes_in_grey_blurred_and_noisy_too(self) -> None:
        def halves(heading: float) -> NDArray[np.float64]:
            """Mean lightness of the left and the right half, where walls are."""
            world = world_with(stadium(6.0, 20.0), [300.0], heading=heading)
            shot = picture(world, CameraSpec(channels=1, blur=1, noise=6.0))[24:30]
            return shot.reshape(6, 2, 32).astype(np.float64).mean(axis=(0, 2))

        along, leftward, back, rightward = map(halves, np.arange(4) * np.pi / 2)
        assert along[0] - along[1] > 15.0
        assert back[0] - back[1] < -15.0
        assert (leftward - rightward > 15.0).all()


VISIBLE = {
    "x",
    "y",
    "z",
    "cos_yaw",
    "sin_yaw",
    "slope_x",
    "slope_y",
    "steering",
    "brake",
    "driving",
    "row",
    "stage",
}
"""What a camera may tell of another car; the row tells bridges apart, the stage who is in the pit lane."""
FELT = {
    "velocity_x",
    "velocity_y",
    "yaw_rate",
    "acceleration_x",
    "acceleration_y",
    "steering",
    "throttle",
    "brake",
    "asked_pedal",
    "asked_steering",
    "wall_contact",
    "car_contact",
    "wear",
    "fuel",
}
"""What its own sensors tell."""
PLACED = {"x", "y", "z", "cos_yaw", "sin_yaw", "slope_x", "slope_y", "row"}
"""Where the camera is."""


def other(value: Any) -> Any:
    """Another value of a field."""
    return ~value if value.dtype == np.bool_ else np.nan_to_num(value, nan=3.0, neginf=3.0) + 1


class TestNothingPrivileged:
    @pytest.fixture
    def world(self) -> World:
        """A car behind another on a circle, which looks the same from everywhere."""
        return world_with(circle(300.0), [50.0, 62.0], [0.0, -1.5], 20.0)

    @pytest.mark.parametrize("mount", MOUNTS)
    @pytest.mark.parametrize("car", [0, 1])
    def test_of_all_that_a_state_holds(self, world: World, car: int, mount: str) -> None:
        spec = ObservationSpec(camera=CameraSpec(mount=mount))
        before, state = seen(world, spec).tobytes(), world.state.copy()
        told = set()
        for name in get_type_hints(CarRecord):
            world.state[name][0, car] = other(state[name][0, car])
            if seen(world, spec).tobytes() != before:
                told.add(name)
            world.state[:] = state
        allowed = VISIBLE if car == 1 else FELT | PLACED | (VISIBLE if mount == "chase" else set())
        assert told <= allowed
        assert told >= ({"x", "y", "brake", "driving"} if car == 1 else FELT)

    def test_the_same_place_of_another_lap(self, world: World) -> None:
        before = seen(world).tobytes()
        world.reset(0, start_at([50.0 + 3 * world.track.length, 62.0], [0.0, -1.5], 20.0))
        assert world.state["laps"][0].tolist() == [3, 0]
        assert seen(world).tobytes() == before

    def test_a_car_behind_a_hill(self) -> None:
        middle = STRAIGHT_M / 2
        world = world_with(crest(), [middle - 70.0, middle + 60.0])
        hidden = seen(world).tobytes()
        world.state["driving"][0, 1] = False
        assert seen(world).tobytes() == hidden
        world.reset(0, start_at([middle - 70.0, middle]))
        assert seen(world).tobytes() != hidden

    def test_a_car_below_a_bridge(self) -> None:
        track = eight()
        [crossing] = find_crossings(track.table[:, [X, Y]])
        rows = sorted((crossing.first, crossing.second), key=lambda row: track.table[row, Z])
        below, above = (row * track.spacing for row in rows)
        world = world_with(track, [above - 25.0, below])
        hidden = seen(world).tobytes()
        world.state["driving"][0, 1] = False
        assert seen(world).tobytes() == hidden
        world.reset(0, start_at([above - 25.0, above]))
        assert seen(world).tobytes() != hidden

    def test_brake_lights_are_red(self) -> None:
        world = world_with(stadium(), [1000.0, 1030.0])
        off = picture(world, CameraSpec()).astype(np.int64)
        world.state["brake"][0, 1] = 0.6
        gained = picture(world, CameraSpec()) - off
        assert gained[:, :, 0].max() > 60
        assert gained[:, :, 1].max() <= 10


def test_sensors_tell_what_the_state_holds(tmp_path: Path) -> None:
    world = world_with(stadium(), [1000.0], 0.0, 30.0)
    drive(world, -0.4, 0.2, seconds=0.3)
    mean, deviation = SPEC.scaling
    values = seen(world)["sensors"] * deviation + mean
    told = {field.name: values[SPEC.slice(field.name)] for field in SPEC.fields}
    state = world.state[0, 0]
    np.testing.assert_allclose(told["velocity"], [state["velocity_x"], state["velocity_y"]], atol=1e-4)
    np.testing.assert_allclose(told["last_action"], [-0.4, 0.2], atol=1e-6)
    np.testing.assert_allclose(told["steering"], state["steering"] / GT3.steering.full_lock_rad, atol=1e-6)
    np.testing.assert_allclose([told["brake"][0], told["throttle"][0]], [0.4, 0.0], atol=1e-6)
    np.testing.assert_allclose(told["fuel"], 1.0, atol=1e-6)
