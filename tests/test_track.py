"""Circuits: closed forms on a circle, the shipped circuit, and what is said about faulty files."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from sim.errors import InputError
from sim.track import (
    CIRCUITS,
    CURVATURE,
    LEFT,
    LEFT_X,
    LEFT_Y,
    RIGHT,
    RIGHT_X,
    RIGHT_Y,
    TANGENT_X,
    TANGENT_Y,
    WALL_LEFT,
    WALL_RIGHT,
    X,
    Y,
    load_track,
    read_track,
)
from tests.driving import circle, drive, world_with

LINDENRING = load_track("lindenring")


def test_circle_has_its_circumference_and_curvature() -> None:
    track = circle(100.0)
    # 360 points on a cubic spline err by (pi / 180)^4; rows are chords of a twentieth of a point.
    assert track.length == pytest.approx(2 * np.pi * 100.0, rel=1e-6)
    np.testing.assert_allclose(track.table[:, CURVATURE], 0.01, rtol=1e-4)
    np.testing.assert_allclose(np.hypot(track.table[:, X], track.table[:, Y]), 100.0, atol=1e-4)
    np.testing.assert_allclose(np.hypot(track.table[:, LEFT_X], track.table[:, LEFT_Y]), 94.0, atol=1e-3)
    np.testing.assert_allclose(np.hypot(track.table[:, RIGHT_X], track.table[:, RIGHT_Y]), 106.0, atol=1e-3)


def test_pose_is_along_and_left_of_the_centre_line() -> None:
    quarter = np.pi / 2 * 100.0
    x, y, heading = circle(100.0).pose(np.array([quarter, -quarter, 5 * quarter]), np.array([3.0, 0.0, -2.0]))
    # Between rows 2 m apart the chord of a radius of 100 m is at most 5 mm inside.
    np.testing.assert_allclose(x, [0.0, 0.0, 0.0], atol=0.01)
    np.testing.assert_allclose(y, [97.0, -100.0, 102.0], atol=0.01)
    np.testing.assert_allclose(np.cos(heading), [-1.0, 1.0, -1.0], atol=1e-3)


def test_a_car_is_located_where_it_was_put() -> None:
    track = circle(100.0)
    for distance in (0.7, 123.4, track.length - 0.7, -31.0):
        for lateral in (-5.0, 0.0, 4.0):
            car = world_with(track, [distance], lateral=lateral, heading=0.1).state[0, 0]
            # Rows are 2 m apart; a chord lies 5 mm inside its arc.
            assert car["progress"] == pytest.approx(distance, abs=0.01)
            assert car["lateral"] == pytest.approx(lateral, abs=0.01)
            assert car["heading_error"] == pytest.approx(0.1, abs=1e-3)


def test_progress_is_followed_round_the_circle() -> None:
    track = circle(100.0, half_width=30.0, wall=50.0)
    world = world_with(track, [-20.0], speed=20.0)
    for _ in range(400):
        car = world.state[0, 0]
        wanted = 2.65 / 100.0 - 0.01 * car["lateral"] - 0.3 * car["heading_error"]
        drive(world, float(np.clip(20.0 - car["velocity_x"], -1, 1)), float(np.clip(wanted / 0.36, -1, 1)))
        angle = np.arctan2(car["y"], car["x"])
        turns = (car["progress"] / track.length - angle / (2 * np.pi)) % 1.0
        assert min(turns, 1.0 - turns) * track.length < 0.02
        assert car["lateral"] == pytest.approx(100.0 - np.hypot(car["x"], car["y"]), abs=0.01)
    assert world.state[0, 0]["progress"] > track.length


def test_lindenring_closes_and_turns_once_clockwise() -> None:
    table = LINDENRING.table
    assert 4550.0 < LINDENRING.length < 4650.0
    steps = np.hypot(*(np.roll(table[:, [X, Y]], -1, axis=0) - table[:, [X, Y]]).T)
    np.testing.assert_allclose(steps, LINDENRING.spacing, rtol=0.002)
    np.testing.assert_allclose(np.hypot(table[:, TANGENT_X], table[:, TANGENT_Y]), 1.0)
    assert table[:, CURVATURE].sum() * LINDENRING.spacing == pytest.approx(-2 * np.pi, rel=1e-3)


def test_lindenring_tangents_and_curvatures_are_those_of_its_points() -> None:
    table, spacing = LINDENRING.table, LINDENRING.spacing
    ahead, behind = np.roll(table, -1, axis=0), np.roll(table, 1, axis=0)
    chord = (ahead - behind)[:, [X, Y]] / (2 * spacing)
    np.testing.assert_allclose(table[:, [TANGENT_X, TANGENT_Y]], chord, atol=0.003)
    turned = np.angle(
        (ahead[:, TANGENT_X] + 1j * ahead[:, TANGENT_Y]) / (behind[:, TANGENT_X] + 1j * behind[:, TANGENT_Y])
    )
    np.testing.assert_allclose(table[:, CURVATURE], turned / (2 * spacing), atol=0.001)


def test_lindenring_walls_are_outside_the_edges_and_edges_do_not_cross() -> None:
    table = LINDENRING.table
    assert (table[:, WALL_LEFT] > table[:, LEFT]).all()
    assert (table[:, WALL_RIGHT] > table[:, RIGHT]).all()
    # An edge folds over where it lies beyond the centre of the bend.
    assert (table[:, CURVATURE] * table[:, WALL_LEFT] < 1.0).all()
    assert (-table[:, CURVATURE] * table[:, WALL_RIGHT] < 1.0).all()


def test_lindenring_corners_bend_more_than_the_road_between() -> None:
    table = LINDENRING.table
    assert [corner.name for corner in LINDENRING.corners][:4] == ["Linde", "Mühle", "Auslauf", "Haarnadel"]
    inside = np.zeros(len(table), np.bool_)
    along = np.arange(len(table)) * LINDENRING.spacing
    for corner in LINDENRING.corners:
        assert 0.0 <= corner.start_m < corner.end_m < LINDENRING.length
        inside |= (along >= corner.start_m) & (along <= corner.end_m)
    bend = np.abs(table[:, CURVATURE])
    assert bend[inside].mean() > 5 * bend[~inside].mean()


def edited(folder: Path, file: str, old: str, new: str) -> Path:
    """The shipped circuit with one place of one of its files changed; the path of its TOML file."""
    copy = folder / "circuit"
    shutil.copytree(CIRCUITS / "lindenring", copy)
    text = (copy / file).read_text("utf-8")
    assert old in text
    (copy / file).write_text(text.replace(old, new, 1), "utf-8")
    return copy / "circuit.toml"


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("kerb_width_m = 1.0", "kerb_width_m = -1.0", "circuit.toml: field kerb_width_m is -1.0"),
        ("verge_grip = 0.55", "verge_grip = 0.0", "circuit.toml: field verge_grip is 0.0"),
        ("verge_grip = 0.55", "", "circuit.toml: field verge_grip: Field required"),
        ("verge_grip", "gravel_grip", "circuit.toml: field "),
        ("spacing_m = 9.0", "spacing_m = 0.0", "circuit.toml: field grid.spacing_m is 0.0"),
        ("start_m = 345.0", "start_m = -345.0", r"circuit.toml: field corner.0.start_m is -345.0"),
        ("[grid]", "[grid", "circuit.toml: not a TOML file"),
        ("centre_line.csv", "lost.csv", "lost.csv: cannot read the centre line"),
    ],
)
def test_faulty_circuit_file_is_named_with_the_field(
    tmp_path: Path, old: str, new: str, complaint: str
) -> None:
    with pytest.raises(InputError, match=complaint):
        read_track(edited(tmp_path, "circuit.toml", old, new))


def rows() -> list[str]:
    return (CIRCUITS / "lindenring" / "centre_line.csv").read_text("utf-8").split()


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        ("0,0,-6,6,10,10", "expected finite positions and positive widths"),
        ("nan,0,6,6,10,10", "expected finite positions and positive widths"),
        ("0,0,6,6,5,10", "wall_right_m, wall_left_m: expected walls outside the edges"),
        ("0,0,6,6,10", "expected "),
        ("0,0,6,6,10,wall", "expected 6 numbers on every line"),
    ],
)
def test_faulty_row_of_the_centre_line(tmp_path: Path, row: str, complaint: str) -> None:
    path = edited(tmp_path, "centre_line.csv", rows()[7], row)
    with pytest.raises(InputError, match=f"centre_line.csv: {complaint}"):
        read_track(path)


def test_faulty_heading_and_too_few_rows(tmp_path: Path) -> None:
    path = edited(tmp_path, "centre_line.csv", "x_m", "x_ft")
    with pytest.raises(InputError, match="first line: expected the column names x_m,y_m,w_tr_right_m"):
        read_track(path)
    (path.parent / "centre_line.csv").write_text("\n".join(rows()[:10]))
    with pytest.raises(InputError, match="expected at least 20 lines of 6 numbers"):
        read_track(path)


def test_unknown_circuit_lists_the_known() -> None:
    with pytest.raises(InputError, match="circuit 'monza' is unknown; expected one of lindenring"):
        load_track("monza")
