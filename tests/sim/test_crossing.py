"""Circuits that cross themselves: found in closed forms, bridged by the import, and raced on two levels."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from nathlon.policies.driver import Driver
from nathlon.policies.policy import Policy
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.track import (
    LEFT,
    LEVEL,
    RIGHT,
    SLOPE,
    WALL_LEFT,
    WALL_RIGHT,
    Track,
    X,
    Y,
    Z,
    load_track,
    read_track,
)
from nathlon.sim.track.crossing import CLEARANCE_M, NEAR_M, bridge_heights, find_crossings
from nathlon.sim.track.importing import import_circuit
from nathlon.sim.world import World
from tests.policies.test_driver import run
from tests.support.centre_lines import write_line
from tests.support.driving import GT3, drive, start_at, world_with


def eight(width: float = 400.0, height: float = 250.0, start: float = 0.8, points: int = 300) -> NDArray:
    """A figure of eight; its branches cross in the middle at the angle 2 atan(width / 2 height)."""
    angle = start + np.linspace(0.0, 2 * np.pi, points, endpoint=False)
    return np.stack([width * np.sin(angle), height * np.sin(2 * angle)], axis=1)


def imported(folder: Path, points: NDArray, half_width: float = 5.0) -> Path:
    source = write_line(folder / "line.csv", points, half_width, half_width)
    return import_circuit(source, "eight", folder / "circuits").path


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The circuit file of the figure of eight."""
    return imported(tmp_path_factory.mktemp("eight"), eight())


@pytest.fixture(scope="module")
def track(path: Path) -> Track:
    return load_track(str(path))


def crossing_m(track: Track) -> tuple[float, float]:
    """Where the lower and the upper road meet, m along the centre line."""
    (crossing,) = find_crossings(track.table[:, [X, Y]])
    return crossing.first * track.spacing, crossing.second * track.spacing


class TestGeometry:
    @pytest.mark.parametrize("start", [0.0, 0.8, np.pi, 4.0])
    def test_an_eight_crosses_itself_once_wherever_its_points_lie(self, start: float) -> None:
        # From 0 and pi, a point of each branch lies in the middle, up to rounding.
        (crossing,) = find_crossings(eight(start=start))
        between = (crossing.second - crossing.first) % 300
        assert between == pytest.approx(150, abs=1)
        assert crossing.angle == pytest.approx(2 * np.arctan(400.0 / 500.0), abs=0.02)

    @given(st.floats(0.1, 1.4), st.integers(0, 399), st.booleans())
    @settings(max_examples=25, deadline=None)
    def test_a_lissajous_curve_has_its_seven_nodes(self, phase: float, roll: int, back: bool) -> None:
        angle = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)
        line = np.stack([np.sin(2 * angle), np.sin(3 * angle + phase)], axis=1)
        rolled = np.roll(line, roll, axis=0)
        assert len(find_crossings(rolled[::-1] if back else rolled)) == 7

    def test_a_line_that_stays_apart_does_not_cross_itself(self) -> None:
        angle = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)
        assert find_crossings(np.stack([np.cos(angle), 0.1 * np.sin(angle)], axis=1)) == []

    def test_every_crossing_of_many_has_its_bridge(self) -> None:
        angle = np.linspace(0.0, 2 * np.pi, 4000, endpoint=False)
        line = 600.0 * np.stack([np.sin(2 * angle), np.sin(3 * angle + 0.7)], axis=1)
        crossings = find_crossings(line)
        height = bridge_heights(crossings, len(line), 3.0)
        assert len(crossings) == 7
        for first, second, _ in crossings:
            assert height[second] - height[first] == pytest.approx(CLEARANCE_M)


class TestImport:
    def test_the_later_road_is_a_bridge_over_the_earlier(self, track: Track) -> None:
        lower, upper = (round(at / track.spacing) for at in crossing_m(track))
        height = track.table[:, Z]
        assert height[upper] == pytest.approx(CLEARANCE_M / 2, abs=0.05)
        assert height[lower] == pytest.approx(-CLEARANCE_M / 2, abs=0.05)
        # Wherever one road lies above the other.
        below, above = (track.table[at - 15 : at + 16] for at in (lower, upper))
        gaps = np.hypot(*(below[:, None, [X, Y]] - above[None, :, [X, Y]]).transpose(2, 0, 1))
        over = gaps < 10.0
        assert over.any()
        assert (above[None, :, Z] - below[:, None, Z])[over].min() > 0.95 * CLEARANCE_M
        assert np.abs(track.table[:, SLOPE]).max() < 0.03
        assert "level but for 1 bridge" in track.description

    def test_levels_reach_as_far_as_cars_mind_each_other(self, track: Track) -> None:
        lower, upper = crossing_m(track)
        along = np.arange(len(track.table)) * track.spacing
        for at, level in ((lower, -1.0), (upper, 1.0)):
            assert (track.table[np.abs(along - at) < NEAR_M - 2.0, LEVEL] == level).all()
        far = (np.abs(along - lower) > NEAR_M + 2.0) & (np.abs(along - upper) > NEAR_M + 2.0)
        assert (track.table[far, LEVEL] == 0.0).all()

    def test_walls_stand_at_the_edges_of_the_bridge_and_let_the_road_below_through(
        self, track: Track
    ) -> None:
        rows = [round(at / track.spacing) for at in crossing_m(track)]
        near = track.table[np.add.outer(rows, np.arange(-4, 5)).ravel()]
        np.testing.assert_allclose(near[:, WALL_LEFT], near[:, LEFT], atol=0.6)
        np.testing.assert_allclose(near[:, WALL_RIGHT], near[:, RIGHT], atol=0.6)
        world = world_with(track, [at - 40.0 for at in crossing_m(track)], speed=30.0)
        drive(world, 0.2, seconds=2.5)
        assert (world.state["wall_s"] == 0.0).all()

    @given(st.floats(15.0, 75.0), st.floats(2.0, 8.0))
    @settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
    def test_roads_cross_at_30_degrees_or_more_or_not_at_all(
        self, tmp_path_factory: pytest.TempPathFactory, degrees: float, half_width: float
    ) -> None:
        folder = tmp_path_factory.mktemp("angle")
        flat = eight(600.0, 300.0 * np.tan(np.radians(degrees) / 2), points=400)
        if degrees < 29.5:
            with pytest.raises(
                InputError, match=r"edges .* cross, expected .* bridges, at 30 degrees or more"
            ):
                imported(folder, flat, half_width)
        elif degrees > 30.5:
            table = read_track(imported(folder, flat, half_width)).table
            assert (table[table[:, LEVEL] > 0, Z] > 0).mean() > 0.9
            assert set(table[:, LEVEL]) == {-1.0, 0.0, 1.0}

    def test_a_loop_too_short_to_climb_is_refused(self, tmp_path: Path) -> None:
        angle = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)
        size = 230.0 * (0.8 + np.cos(angle))
        with pytest.raises(
            InputError, match=r"a bridge .* would need a slope of \d+ %, expected at most 5 %"
        ):
            imported(tmp_path, np.stack([size * np.cos(angle), size * np.sin(angle)], axis=1), 2.5)

    def test_a_file_with_a_crossing_but_no_bridge_is_refused(self, tmp_path: Path, path: Path) -> None:
        copy = shutil.copytree(path.parent, tmp_path / "flat")
        head, *rows = (copy / "centre_line.csv").read_text("utf-8").split()
        cells = [row.split(",") for row in rows]
        level = [",".join([*row[:2], "0", *row[3:]]) for row in cells]
        (copy / "centre_line.csv").write_text("\n".join([head, *level]), "utf-8")
        with pytest.raises(
            InputError, match=r"centre_line.csv: near x_m -?\d, .*: z_m differs by 0.0 m, exp"
        ):
            read_track(copy / "circuit.toml")


class TestTwoLevels:
    def test_cars_above_and_below_each_other_do_not_touch(self, track: Track) -> None:
        lower, upper = crossing_m(track)
        world = world_with(track, [lower, upper])
        before = world.state.copy()
        drive(world, 0.0, seconds=0.5)
        assert not world.state["car_contact"].any()
        assert world.contact_count.tolist() == [0]
        np.testing.assert_allclose(world.state["x"], before["x"], atol=0.1)
        assert world.state["z"][0, 1] - world.state["z"][0, 0] == pytest.approx(CLEARANCE_M, abs=0.1)

    def test_cars_on_the_same_level_do(self, track: Track) -> None:
        for at in crossing_m(track):
            world = world_with(track, [at - 2.0, at], speed=[30.0, 20.0])
            drive(world, 0.0, seconds=0.5)
            assert world.state["contacts"].tolist() == [[1, 1]]

    def test_who_crosses_above_changes_nothing_below(self, track: Track) -> None:
        """Two cars come by at the same time; each fares as it does alone, to the bit."""
        lower, upper = crossing_m(track)
        spec = ObservationSpec()
        together = world_with(track, [lower - 100.0, upper - 100.0], speed=45.0)
        alone = [world_with(track, [at - 100.0], speed=45.0) for at in (lower, upper)]
        closest = np.inf
        for _ in range(45):
            for world in (together, *alone):
                drive(world, 0.1)
            seen = together.observe(spec, np.zeros(2, np.int64), np.arange(2))
            for car, world in enumerate(alone):
                assert world.state[0, 0].tobytes() == together.state[0, car].tobytes()
                np.testing.assert_array_equal(
                    world.observe(spec, np.zeros(1, int), np.zeros(1, int))[0], seen[car]
                )
            closest = min(closest, float(np.hypot(*(np.diff(together.state[0][name])[0] for name in "xy"))))
        assert closest < 5.0

    def test_a_car_astray_stays_on_its_road(self, track: Track) -> None:
        for at in crossing_m(track):
            for heading in (-0.6, 0.6):
                world = world_with(track, [at - 30.0], speed=35.0, heading=heading)
                progress = [float(drive(world, 0.3)["progress"][0, 0]) for _ in range(40)]
                assert world.state["wall_s"][0, 0] > 0.0
                assert np.abs(np.diff(progress)).max() < 5.0
                assert np.abs(world.state["lateral"]).max() < 6.0

    def test_the_driver_gets_round_clean_in_company(self, path: Path, track: Track) -> None:
        drivers: list[list[Policy]] = [[Driver(str(path), "gt3", pace) for pace in (0.9, 1.0)]]
        world = World(track, GT3, 1, 2)
        world.reset(0, start_at(list(crossing_m(track)), speed=30.0, finish=2.5 * track.length))
        run(world, drivers, 150.0)
        state = world.state[0]
        assert (state["laps"] >= 2).all()
        assert state["off_course_s"].tolist() == [0.0, 0.0]
        assert state["wall_s"].tolist() == [0.0, 0.0]
