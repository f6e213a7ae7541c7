"""Circuits: closed forms in three dimensions, the shipped circuits, and what is said about faulty files."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from nathlon.sim.data_file import DATA
from nathlon.sim.errors import InputError
from nathlon.sim.track import (
    BANK,
    CREST,
    CURVATURE,
    KERB_LEFT,
    KERB_RIGHT,
    LEFT,
    RIGHT,
    RUNOFF_LEFT,
    RUNOFF_RIGHT,
    SECTION,
    SLOPE,
    SURFACES,
    TANGENT_X,
    TANGENT_Y,
    TAPER_M,
    TWIST,
    WALL_LEFT,
    WALL_RIGHT,
    ZONE,
    Track,
    X,
    Y,
    Z,
    load_track,
    read_track,
)
from nathlon.sim.track.map import draw_map
from tests.support.driving import circle, drive, road, world_with

CIRCUITS = DATA / "circuits"
NAMES = sorted(folder.name for folder in CIRCUITS.iterdir())


def hilly() -> Track:
    """A circle of 200 m that rises and falls by 10 m twice a lap and is banked by up to 0.2 rad, once."""
    angle = np.linspace(0.0, 2 * np.pi, 360, endpoint=False)
    return road(
        200 * np.cos(angle),
        200 * np.sin(angle),
        6.0,
        12.0,
        z=10 * np.sin(2 * angle),
        bank=0.2 * np.cos(angle),
    )


HILLY = hilly()
ALONG = np.arange(len(HILLY.table)) * HILLY.spacing
ANGLE = ALONG / 200.0


class TestMap:
    def test_circle_has_its_circumference_and_curvature(self) -> None:
        track = circle(100.0)
        # 360 points on a cubic spline err by (pi / 180)^4; rows are chords of a twentieth of a point.
        assert track.length == pytest.approx(2 * np.pi * 100.0, rel=1e-6)
        np.testing.assert_allclose(track.table[:, CURVATURE], 0.01, rtol=1e-4)
        np.testing.assert_allclose(np.hypot(track.table[:, X], track.table[:, Y]), 100.0, atol=1e-4)

    def test_pose_is_along_and_left_of_the_centre_line(self) -> None:
        quarter = np.pi / 2 * 100.0
        along = np.array([quarter, -quarter, 5 * quarter])
        x, y, heading = circle(100.0).pose(along, np.array([3.0, 0.0, -2.0]))
        # Between rows 2 m apart the chord of a radius of 100 m is at most 5 mm inside.
        np.testing.assert_allclose(x, [0.0, 0.0, 0.0], atol=0.01)
        np.testing.assert_allclose(y, [97.0, -100.0, 102.0], atol=0.01)
        np.testing.assert_allclose(np.cos(heading), [-1.0, 1.0, -1.0], atol=1e-3)

    @given(st.floats(-800.0, 2000.0), st.floats(-5.0, 5.0))
    @settings(deadline=None, max_examples=50)
    def test_a_car_is_located_where_it_was_put(self, distance: float, lateral: float) -> None:
        car = world_with(circle(100.0), [distance], lateral=lateral, heading=0.1).state[0, 0]
        # Rows are 2 m apart; a chord lies 5 mm inside its arc.
        assert car["progress"] == pytest.approx(distance, abs=0.01)
        assert car["lateral"] == pytest.approx(lateral, abs=0.01)
        assert car["heading_error"] == pytest.approx(0.1, abs=1e-3)

    def test_progress_is_followed_round_the_circle(self) -> None:
        track = circle(100.0, half_width=30.0, wall=50.0)
        world = world_with(track, [-20.0], speed=20.0)
        for _ in range(400):
            car = world.state[0, 0]
            wanted = 2.65 / 100.0 - 0.01 * car["lateral"] - 0.3 * car["heading_error"]
            drive(
                world, float(np.clip(20.0 - car["velocity_x"], -1, 1)), float(np.clip(wanted / 0.36, -1, 1))
            )
            angle = np.arctan2(car["y"], car["x"])
            turns = (car["progress"] / track.length - angle / (2 * np.pi)) % 1.0
            assert min(turns, 1.0 - turns) * track.length < 0.02
            assert car["lateral"] == pytest.approx(100.0 - np.hypot(car["x"], car["y"]), abs=0.01)
        assert world.state[0, 0]["progress"] > track.length


class TestSpace:
    def test_height_bank_and_their_derivatives_have_their_closed_forms(self) -> None:
        table = HILLY.table
        np.testing.assert_allclose(table[:, Z], 10 * np.sin(2 * ANGLE), atol=1e-4)
        np.testing.assert_allclose(table[:, SLOPE], 0.1 * np.cos(2 * ANGLE), atol=1e-5)
        # Banks are interpolated straight between points 3.5 m apart.
        np.testing.assert_allclose(table[:, BANK], np.tan(0.2 * np.cos(ANGLE)), atol=1e-4)
        # Crest and twist are those from row to row, so they belong to the middle between rows.
        middle = ANGLE + HILLY.spacing / 400.0
        np.testing.assert_allclose(table[:, CREST], -0.001 * np.sin(2 * middle), atol=2e-6)
        twist = -0.001 * np.sin(middle) / np.cos(0.2 * np.cos(middle)) ** 2
        np.testing.assert_allclose(table[:, TWIST], twist, atol=2e-5)

    @pytest.mark.parametrize("name", NAMES)
    def test_heights_are_the_integral_of_the_slope(self, name: str) -> None:
        track = load_track(name)
        slope, height = track.table[:, SLOPE], track.table[:, Z]
        rise = 0.5 * (slope + np.roll(slope, -1)) * track.spacing
        np.testing.assert_allclose(np.roll(height, -1) - height, rise, atol=2e-3)
        np.testing.assert_allclose(height[0] + np.cumsum(rise), np.roll(height, -1), atol=0.05)

    @pytest.mark.parametrize("name", NAMES)
    def test_slope_and_bank_run_on_from_row_to_row_round_the_lap(self, name: str) -> None:
        track = load_track(name)
        for value, change in ((SLOPE, CREST), (BANK, TWIST)):
            end = track.table[:, value] + track.spacing * track.table[:, change]
            np.testing.assert_allclose(end, np.roll(track.table[:, value], -1), atol=1e-12)

    def test_a_car_feels_the_road_under_it(self) -> None:
        for distance, lateral, heading in ((100.0, 0.0, 0.0), (317.0, 3.0, 0.4), (900.0, -4.0, -2.0)):
            car = world_with(HILLY, [distance], lateral=lateral, heading=heading).state[0, 0]

            def surface(x: float, y: float) -> float:
                """Height of the ruled surface, exact."""
                angle, aside = np.arctan2(y, x), 200.0 - np.hypot(x, y)
                return float(10 * np.sin(2 * angle) + np.tan(0.2 * np.cos(angle)) * aside)

            x, y, yaw, h = car["x"], car["y"], car["yaw"], 1e-4
            ahead = surface(x + h * np.cos(yaw), y + h * np.sin(yaw))
            aside = surface(x - h * np.sin(yaw), y + h * np.cos(yaw))
            assert car["z"] == pytest.approx(surface(x, y), abs=5e-3)
            assert car["slope_x"] == pytest.approx((ahead - surface(x, y)) / h, abs=1e-3)
            assert car["slope_y"] == pytest.approx((aside - surface(x, y)) / h, abs=1e-3)

    def test_offset_line_lies_on_the_banked_surface(self) -> None:
        line = HILLY.offset_line(4.0)
        np.testing.assert_allclose(np.hypot(line[:, 0], line[:, 1]), 196.0, atol=1e-3)
        np.testing.assert_allclose(
            line[:, 2], 10 * np.sin(2 * ANGLE) + 4.0 * np.tan(0.2 * np.cos(ANGLE)), atol=1e-3
        )

    def test_edges_are_the_offset_lines_at_the_widths(self) -> None:
        lines = (HILLY.offset_line(6.0), HILLY.offset_line(0.0), HILLY.offset_line(-6.0))
        for place, line in enumerate(lines):
            np.testing.assert_allclose(HILLY.edges[:, [place, place + 4, place + 8]], line, atol=1e-4)


class TestFeatures:
    TRACK = staticmethod(
        lambda: road(
            100 * np.cos(np.linspace(0, 2 * np.pi, 180, endpoint=False)),
            100 * np.sin(np.linspace(0, 2 * np.pi, 180, endpoint=False)),
            6.0,
            12.0,
            runoff="tarmac",
            kerb=(
                {"side": "left", "start_m": 50.0, "end_m": 100.0, "width_m": 1.5},
                {"side": "right", "start_m": 90.0, "end_m": 130.0, "width_m": 0.8},
            ),
            runoff_stretch=({"side": "right", "start_m": 200.0, "end_m": 300.0, "surface": "gravel"},),
            penalty_zone=({"start_m": 400.0, "end_m": 500.0},),
            section=(
                {"name": "Erste", "kind": "straight", "start_m": 0.0, "end_m": 60.0},
                {"name": "Zweite", "kind": "corner", "start_m": 60.0, "end_m": 120.0},
                {"name": "Dritte", "kind": "chicane", "start_m": 150.0, "end_m": 200.0},
                {"name": "Vierte", "kind": "straight", "start_m": 200.0, "end_m": 350.0},
                {"name": "Letzte", "kind": "chicane", "start_m": 350.0, "end_m": 400.0},
            ),
        )
    )

    def test_kerbs_grow_to_their_width_and_end_where_they_should(self) -> None:
        track = self.TRACK()
        along = np.arange(len(track.table)) * track.spacing
        left, right = track.table[:, KERB_LEFT], track.table[:, KERB_RIGHT]
        assert (left[(along <= 50.0) | (along >= 100.0)] == 0.0).all()
        assert (left[(along >= 50.0 + TAPER_M) & (along <= 100.0 - TAPER_M)] == 1.5).all()
        at = np.argmin(np.abs(along - 54.0))
        assert left[at] == pytest.approx(1.5 * (along[at] - 50.0) / TAPER_M)
        assert right.max() == 0.8
        assert (right[(along <= 90.0) | (along >= 130.0)] == 0.0).all()

    def test_stretches_have_their_surface_and_zones_their_flag(self) -> None:
        track = self.TRACK()
        along = np.arange(len(track.table)) * track.spacing
        gravel = (along >= 200.0) & (along < 300.0)
        tarmac, rough = SURFACES.index("tarmac"), SURFACES.index("gravel")
        assert (track.table[:, RUNOFF_RIGHT] == np.where(gravel, rough, tarmac)).all()
        assert (track.table[:, RUNOFF_LEFT] == tarmac).all()
        assert ((track.table[:, ZONE] == 1.0) == ((along >= 400.0) & (along < 500.0))).all()

    def test_sections_are_found_by_place_and_by_name(self) -> None:
        track = self.TRACK()
        for distance, name in (
            (10.0, "Erste"),
            (80.0, "Zweite"),
            (130.0, ""),
            (track.length + 10.0, "Erste"),
            (-1.0, ""),
            (420.0 - track.length, ""),
            (380.0 - track.length, "Letzte"),
        ):
            assert track.section_at(distance) == name
        assert track.stretch("Dritte") == (150.0, 200.0)
        assert track.stretch("longest straight") == (200.0, 350.0)
        assert track.stretch("last chicane") == (350.0, 400.0)
        with pytest.raises(InputError, match="circuit 'test road' has no section 'Fünfte'"):
            track.stretch("Fünfte")
        with pytest.raises(InputError, match="has no section 'last chicane'"):
            circle(100.0).stretch("last chicane")


@pytest.mark.parametrize("name", NAMES)
class TestShipped:
    def test_it_closes_and_turns_once(self, name: str) -> None:
        track = load_track(name)
        table = track.table
        steps = np.hypot(*(np.roll(table[:, [X, Y]], -1, axis=0) - table[:, [X, Y]]).T)
        np.testing.assert_allclose(steps, track.spacing, rtol=0.002)
        np.testing.assert_allclose(np.hypot(table[:, TANGENT_X], table[:, TANGENT_Y]), 1.0)
        turned = table[:, CURVATURE].sum() * track.spacing
        assert abs(turned) == pytest.approx(2 * np.pi, rel=1e-3)

    def test_tangents_and_curvatures_are_those_of_its_points(self, name: str) -> None:
        table, spacing = load_track(name).table, load_track(name).spacing
        ahead, behind = np.roll(table, -1, axis=0), np.roll(table, 1, axis=0)
        chord = (ahead - behind)[:, [X, Y]] / (2 * spacing)
        np.testing.assert_allclose(table[:, [TANGENT_X, TANGENT_Y]], chord, atol=0.005)
        turn = (ahead[:, TANGENT_X] + 1j * ahead[:, TANGENT_Y]) / (
            behind[:, TANGENT_X] + 1j * behind[:, TANGENT_Y]
        )
        np.testing.assert_allclose(table[:, CURVATURE], np.angle(turn) / (2 * spacing), atol=0.003)

    def test_walls_are_outside_the_kerbs_and_nothing_folds_over(self, name: str) -> None:
        table = load_track(name).table
        assert (table[:, WALL_LEFT] >= table[:, LEFT] + table[:, KERB_LEFT]).all()
        assert (table[:, WALL_RIGHT] >= table[:, RIGHT] + table[:, KERB_RIGHT]).all()
        # An edge folds over where it lies beyond the centre of the bend.
        assert (table[:, CURVATURE] * table[:, WALL_LEFT] < 1.0).all()
        assert (-table[:, CURVATURE] * table[:, WALL_RIGHT] < 1.0).all()

    def test_corners_bend_more_than_straights(self, name: str) -> None:
        track = load_track(name)
        bend = {
            kind: np.abs(track.table[:, CURVATURE])[
                np.isin(
                    track.table[:, SECTION],
                    [i for i, section in enumerate(track.sections) if (section.kind == "straight") == kind],
                )
            ].mean()
            for kind in (True, False)
        }
        assert bend[False] > 5 * bend[True]
        names = [section.name for section in track.sections]
        assert len(set(names)) == len(names)

    def test_twenty_places_of_the_grid_lie_on_a_straight_road(self, name: str) -> None:
        track = load_track(name)
        grid = track.grid
        distance = grid.pole_m - grid.spacing_m * np.arange(20)
        row = (np.mod(distance, track.length) / track.spacing).astype(int)
        assert (np.minimum(track.table[row, LEFT], track.table[row, RIGHT]) > grid.lateral_m + 1.2).all()
        assert (np.abs(track.table[row, CURVATURE]) < 1 / 100).all()

    def test_penalty_zones_are_long_enough_and_not_in_tight_bends(self, name: str) -> None:
        track = load_track(name)
        zone = track.table[:, ZONE] == 1.0
        assert zone.sum() * track.spacing > 250.0
        # At 100 km/h the middle of a zone asks for less than 6 m/s^2.
        assert (np.abs(track.table[zone, CURVATURE]) * 27.78**2).max() < 6.0


def edited(folder: Path, file: str, old: str, new: str) -> Path:
    """A shipped circuit with one place of one of its files changed; the path of its TOML file."""
    copy = folder / "circuit"
    shutil.copytree(CIRCUITS / "lindenring", copy)
    text = (copy / file).read_text("utf-8")
    assert old in text
    (copy / file).write_text(text.replace(old, new, 1), "utf-8")
    return copy / "circuit.toml"


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('runoff = "grass"', 'runoff = "sand"', "circuit.toml: field runoff is 'sand': .*'tarmac', 'grass'"),
        ('runoff = "grass"', "", "circuit.toml: field runoff: Field required"),
        ("[grid]", "verge = 1\n[grid]", "field verge is unknown; expected one of .*grid, "),
        ("[grid]", "[grid", "circuit.toml: not a TOML file"),
        ("spacing_m = ", "spacing_m = -", "circuit.toml: field grid.spacing_m is -"),
        ("centre_line.csv", "lost.csv", "lost.csv: cannot read the centre line"),
        ("sectors_m = [", "sectors_m = [5700.0, ", "circuit.toml: field sectors_m"),
        ("sectors_m = [", "sectors_m = [9.0, 99999.0] #", "circuit.toml: sectors_m: 99999 is not on the lap"),
        ("sectors_m = [", "sectors_m = [9.0, 9.0] #", "circuit.toml: .*sectors_m must rise"),
        ('side = "left"', 'side = "inner"', r"circuit.toml: field kerb.\d+.side is 'inner'"),
        ("[[kerb]]", '[[section]]\nname = "A"\nkind = "corner"\nstart_m = 1.0\nend_m = 2.0\n[[kerb]]',
         "circuit.toml: .*section 'A' must begin where .* ends, or later"),
        ("[[kerb]]", '[[kerb]]\nside = "left"\nwidth_m = 1.0\nstart_m = 9.0\nend_m = 8.0\n[[kerb]]',
         "circuit.toml: field kerb.0: start_m must lie before end_m"),
        ("[[kerb]]", '[[kerb]]\nside = "left"\nwidth_m = 1.0\nstart_m = 9.0\nend_m = 99999.0\n[[kerb]]',
         "circuit.toml: kerb: end_m is 99999, expected at most the lap's 5800"),
        ("pole_m = ", "pole_m = 1e308 #", "circuit.toml: grid.pole_m is 1e.308, expected at most the lap's"),
        ("spacing_m = ", "spacing_m = 1e308 #", "circuit.toml: grid.spacing_m is 1e.308, expected at most"),
        ("lateral_m = ", "lateral_m = 9.0 #", "grid.lateral_m is 9, expected places on the road, at most"),
    ],
)  # fmt: skip
def test_faulty_circuit_file_is_named_with_the_field(
    tmp_path: Path, old: str, new: str, complaint: str
) -> None:
    path = edited(tmp_path, "circuit.toml", old, new)
    with pytest.raises(InputError, match=complaint) as caught:
        read_track(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < len(str(path)) + 200


def rows() -> list[str]:
    return (CIRCUITS / "lindenring" / "centre_line.csv").read_text("utf-8").split()


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        ("0,0,0,-6,6,0,10,10", "line 8: w_tr_right_m is '-6', expected a number from 0.5 to 100"),
        ("nan,0,0,6,6,0,10,10", "line 8: x_m is 'nan', expected a number from -1,000,000 to 1,000,000"),
        ("0,0,inf,6,6,0,10,10", "line 8: z_m is 'inf', expected a number from -10,000 to 10,000"),
        ("1e308,0,0,6,6,0,10,10", "line 8: x_m is '1e308', expected a number from -1,000,000 to"),
        ("0,-1e30,0,6,6,0,10,10", "line 8: y_m is '-1e30', expected a number from -1,000,000 to"),
        ("0,0,0,6,1e-320,0,10,10", "line 8: w_tr_left_m is '1e-320', expected a number from 0.5"),
        ("0,0,0,6,6,0,10,1e9", "line 8: wall_left_m is '1e9', expected a number from 0.5 to 1,000"),
        ("200000,0,0,6,6,0,10,10", "x_m, y_m: a lap of 40.,... m with 199,... m before line [89], expected"),
        ("32,0,99,6,6,0,10,10", "line [89]: z_m: a slope of .* from the line before, expected at most 100%"),
        ("0,0,0,6,6,0.7,10,10", "line 8: bank_rad is '0.7', expected a number from -0.6 to 0.6"),
        ("0,0,0,6,6,0,5,10", "line 8: wall_right_m, wall_left_m: expected walls outside the edges"),
        ("0,0,0,6,6,0,10", "line 8: 7 columns, expected 8 numbers on every line"),
        ("0,0,0,6,6,0,10,wall", "line 8: wall_left_m is 'wall', expected a number"),
    ],
)
def test_faulty_row_of_the_centre_line(tmp_path: Path, row: str, complaint: str) -> None:
    path = edited(tmp_path, "centre_line.csv", rows()[7], row)
    with pytest.raises(InputError, match=f"centre_line.csv: {complaint}"):
        read_track(path)


def test_a_repeated_point_is_named(tmp_path: Path) -> None:
    path = edited(tmp_path, "centre_line.csv", rows()[7], rows()[8])
    with pytest.raises(InputError, match=r"line 9: x_m, y_m: expected no point twice in a row"):
        read_track(path)


def test_faulty_heading_and_too_few_rows(tmp_path: Path) -> None:
    path = edited(tmp_path, "centre_line.csv", "x_m", "x_ft")
    with pytest.raises(InputError, match="first line: expected the column names x_m,y_m,z_m,w_tr_right_m"):
        read_track(path)
    (path.parent / "centre_line.csv").write_text("\n".join(rows()[:10]))
    with pytest.raises(InputError, match=r"centre_line.csv: x_m, y_m: 9 points, expected at least 20"):
        read_track(path)


def drawn(folder: Path, x: NDArray[np.float64], y: NDArray[np.float64]) -> Path:
    """The shipped circuit with another centre line, level and as wide everywhere."""
    path = edited(folder, "circuit.toml", "[grid]", "[grid]")
    points = [f"{a!r},{b!r},0,6,6,0,10,10" for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    (path.parent / "centre_line.csv").write_text("\n".join([rows()[0], *points]))
    return path


ROUND = np.linspace(0.0, 2 * np.pi, 1000, endpoint=False)


@pytest.mark.parametrize(
    ("x", "y", "complaint"),
    [
        (1e-4 * np.cos(ROUND), 1e-4 * np.sin(ROUND), "line .*expected no point twice in a row"),
        (10 * np.cos(ROUND), 10 * np.sin(ROUND), "a lap of 63 m .*expected 100 to 100,000 m"),
        (1e5 * np.cos(ROUND), 1e5 * np.sin(ROUND), "a lap of 628,.* m .*expected 100 to 100,000 m"),
        (np.arange(1000.0), 0.0 * ROUND, "line 2: x_m, y_m: the points turn back by 180 degrees"),
        (20 * np.cos(150 * ROUND + ROUND), 20 * np.sin(150 * ROUND + ROUND), "the road lies on itself"),
        (np.tile(ROUND, 101), np.tile(ROUND, 101), "101,000 points, expected at most 100,000"),
        (300 * np.sin(ROUND), 300 * np.sin(2 * ROUND), "the road crosses itself: z_m differs by 0.0 m"),
    ],
)  # fmt: skip
def test_lines_that_are_no_road(
    tmp_path: Path, x: NDArray[np.float64], y: NDArray[np.float64], complaint: str
) -> None:
    path = drawn(tmp_path, x, y)
    # Only the road is at fault.
    text = path.read_text("utf-8")
    bare = text.partition("[[")[0]
    sectors = next(line for line in bare.splitlines() if line.startswith("sectors_m"))
    path.write_text(bare.replace(sectors, "sectors_m = [20.0, 40.0]"), "utf-8")
    with pytest.raises(InputError, match=complaint) as caught:
        read_track(path)
    assert str(caught.value).startswith(str(path.parent / "centre_line.csv"))


def test_the_map_shows_sections_shorter_than_a_row_and_corners_without_a_bend(tmp_path: Path) -> None:
    short = '[[section]]\nname = "short"\nkind = "corner"\nstart_m = 0.1\nend_m = 0.2\n'
    path = edited(tmp_path, "circuit.toml", "[[section]]", f"{short}\n[[section]]")
    text = path.read_text("utf-8")
    first = text.split("[[section]]")[2]
    path.write_text(text.replace(first, first.replace("start_m = 0.0", "start_m = 0.3"), 1), "utf-8")
    draw_map(read_track(path), tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 1000


def test_unknown_circuit_lists_the_known() -> None:
    with pytest.raises(InputError, match="circuit 'monza' is unknown; expected one of grandes-landes, lind"):
        load_track("monza")
