"""Imported circuits: roads of known shape, what no wall may do, and what is said about faulty files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import KDTree

from nathlon.sim.data_file import read_toml
from nathlon.sim.errors import InputError
from nathlon.sim.track import (
    CURVATURE,
    KERB_LEFT,
    KERB_RIGHT,
    LEFT,
    RIGHT,
    RUNOFF_LEFT,
    RUNOFF_RIGHT,
    SURFACES,
    WALL_LEFT,
    WALL_RIGHT,
    CircuitFile,
    Track,
    X,
    Y,
    read_track,
)
from nathlon.sim.track.importing import import_circuit
from tests.support.centre_lines import path_of, stadium, write_line

GRAVEL = SURFACES.index("gravel")


def imported(folder: Path, points: NDArray[np.float64], right: float = 5.0, left: float = 6.0) -> Track:
    """The circuit that becomes of a centre line, read back."""
    source = write_line(folder / "line.csv", points, right, left)
    return read_track(import_circuit(source, "circuit", folder / "circuits").path)


def facts_of(folder: Path) -> CircuitFile:
    return read_toml(folder / "circuits" / "circuit" / "circuit.toml", CircuitFile, "circuit")


def distance_from(track: Track, truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far each row of a track lies from the true line, given densely, m."""
    nearest: NDArray[np.float64] = KDTree(truth).query(track.table[:, [X, Y]])[0]
    return nearest


def along(track: Track) -> NDArray[np.float64]:
    return np.arange(len(track.table), dtype=np.float64) * track.spacing


def crossings(line: NDArray[np.float64], other: NDArray[np.float64]) -> int:
    """Pairs of segments of two closed lines that cross; a line against itself counts each twice."""

    def side(a: NDArray, b: NDArray, c: NDArray) -> NDArray:
        return np.sign(
            (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1])
            - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
        )

    a, b = line[:, None], np.roll(line, -1, axis=0)[:, None]
    c, d = other[None], np.roll(other, -1, axis=0)[None]
    return int(((side(a, b, c) * side(a, b, d) < 0) & (side(c, d, a) * side(c, d, b) < 0)).sum())


def assert_walls_stand_clear(track: Track) -> None:
    """Walls outside edges and kerbs; they neither fold over nor meet each other, anywhere."""
    table = track.table
    assert (table[:, WALL_LEFT] >= table[:, LEFT] + table[:, KERB_LEFT]).all()
    assert (table[:, WALL_RIGHT] >= table[:, RIGHT] + table[:, KERB_RIGHT]).all()
    assert (table[:, CURVATURE] * table[:, WALL_LEFT]).max() < 0.9
    assert (-table[:, CURVATURE] * table[:, WALL_RIGHT]).max() < 0.9
    left = track.offset_line(table[:, WALL_LEFT])[:, :2]
    right = track.offset_line(-table[:, WALL_RIGHT])[:, :2]
    assert crossings(left, left) == crossings(right, right) == crossings(left, right) == 0


def test_a_stadium_has_its_length_curvature_and_widths(tmp_path: Path) -> None:
    track = imported(tmp_path, path_of(stadium()), right=5.0, left=6.0)
    assert track.length == pytest.approx(1200.0 + 2 * np.pi * 80.0, rel=1e-3)
    assert distance_from(track, path_of(stadium(), 0.1)).max() < 0.3
    at, table = along(track), track.table
    straight = (at > 650.0) & (at < 1050.0)
    bend = (at > 360.0) & (at < 490.0)
    np.testing.assert_allclose(table[straight, CURVATURE], 0.0, atol=1e-4)
    np.testing.assert_allclose(table[bend, CURVATURE], 1.0 / 80.0, rtol=0.06)
    np.testing.assert_allclose(table[:, RIGHT], 5.0)
    np.testing.assert_allclose(table[:, LEFT], 6.0)
    assert_walls_stand_clear(track)


def test_points_may_lie_far_apart_on_straights_the_start_line_among_them(tmp_path: Path) -> None:
    points = path_of(stadium())
    straight = np.isclose(np.roll(points, 1, axis=0)[:, 1] - points[:, 1], 0.0)
    thinned = points[~straight | (np.arange(len(points)) % 6 == 0)]
    track = imported(tmp_path, thinned)
    assert distance_from(track, path_of(stadium(), 0.1)).max() < 0.3


def test_the_first_point_is_the_start_line(tmp_path: Path) -> None:
    track = imported(tmp_path, path_of(stadium()))
    x, y, heading = track.pose(np.array([0.0]), np.array([0.0]))
    np.testing.assert_allclose([x[0], y[0], heading[0]], 0.0, atol=0.02)


@pytest.mark.parametrize(("turn", "inside", "outside"), [(1.0, "left", "right"), (-1.0, "right", "left")])
def test_a_stadium_has_two_turns_with_straights_between(
    tmp_path: Path, turn: float, inside: str, outside: str
) -> None:
    imported(tmp_path, path_of(stadium(turn=turn)))
    facts = facts_of(tmp_path)
    bend = np.pi * 80.0
    bounds = [0.0, 300.0, 300.0 + bend, 900.0 + bend, 900.0 + 2 * bend, 1200.0 + 2 * bend]
    names = ["Straight 1", "Turn 1", "Straight 2", "Turn 2", "Straight 3"]
    assert [section.name for section in facts.section] == names
    for section, start, end in zip(facts.section, bounds, bounds[1:], strict=False):
        assert section.kind == ("corner" if section.name.startswith("Turn") else "straight")
        # The smoothing spreads where a bend begins, by a part of its 50 m.
        assert section.start_m == pytest.approx(start, abs=15.0)
        assert section.end_m == pytest.approx(end, abs=15.0)
    apexes = [kerb for kerb in facts.kerb if kerb.side == inside]
    exits = [kerb for kerb in facts.kerb if kerb.side == outside]
    for kerbs, share in ((apexes, 0.5), (exits, 1.0)):
        middles = [(kerb.start_m + kerb.end_m) / 2 for kerb in kerbs]
        np.testing.assert_allclose(middles, [bounds[1] + share * bend, bounds[3] + share * bend], atol=20.0)
    assert {stretch.side for stretch in facts.runoff_stretch} == {outside}
    zones = [(zone.start_m, zone.end_m) for zone in facts.penalty_zone]
    assert zones == [
        pytest.approx((bounds[2], bounds[2] + 240.0), abs=15.0),
        pytest.approx((bounds[4], bounds[4] + 120.0), abs=15.0),
    ]
    length = bounds[-1]
    assert facts.sectors_m == pytest.approx((length / 3, 2 * length / 3), rel=0.01)


def test_run_off_is_wide_outside_bends_and_narrow_along_straights(tmp_path: Path) -> None:
    track = imported(tmp_path, path_of(stadium()))
    at, table = along(track), track.table
    beyond = table[:, WALL_RIGHT] - table[:, RIGHT]
    bend, straight = (at > 310.0) & (at < 550.0), (at > 750.0) & (at < 800.0)
    np.testing.assert_allclose(beyond[bend], 18.0)
    np.testing.assert_allclose(beyond[straight], 5.0)
    np.testing.assert_allclose(table[:, WALL_LEFT] - table[:, LEFT], 5.0)
    assert (table[bend, RUNOFF_RIGHT] == GRAVEL).all()
    assert not (table[straight, RUNOFF_RIGHT] == GRAVEL).any()
    assert not (table[:, RUNOFF_LEFT] == GRAVEL).any()
    assert np.abs(np.diff(beyond)).max() < 1.0


def test_same_way_bends_close_together_are_one_and_a_quick_pair_is_a_chicane(tmp_path: Path) -> None:
    quarter, kink = np.pi / 2, np.radians(50.0)
    shift = 2 * 40.0 * (1 - np.cos(kink))  # of the road by the chicane, to the left
    lower, upper = 80.0, 80.0 + shift / 2
    chicane = [(40.0 * kink, kink), (40.0 * kink, -kink)]
    first = [(lower * quarter, quarter), (20.0, 0.0), (lower * quarter, quarter)]
    second = [(upper * quarter, quarter), (20.0, 0.0), (upper * quarter, quarter)]
    east = 300.0 + 2 * 40.0 * np.sin(kink) + 300.0 + lower - upper
    pieces = [(300.0, 0.0), *chicane, (300.0, 0.0), *first, (east - (lower - upper), 0.0), *second]
    imported(tmp_path, path_of(pieces))
    found = [(section.name, section.kind) for section in facts_of(tmp_path).section]
    assert found == [
        ("Straight 1", "straight"),
        ("Turns 1-2", "chicane"),
        ("Straight 2", "straight"),
        ("Turn 3", "corner"),
        ("Straight 3", "straight"),
        ("Turn 4", "corner"),
    ]


def test_noise_is_smoothed_away_and_corners_stay(tmp_path: Path) -> None:
    points = path_of(stadium(radius=20.0))
    noisy = points + np.random.default_rng(1).normal(0.0, 0.1, points.shape)
    track = imported(tmp_path, noisy)
    # Left alone, noise of 0.1 m every 5 m bends the line by about sqrt(6) * 0.1 / 5^2 = 0.01 per metre.
    assert distance_from(track, path_of(stadium(radius=20.0), 0.1)).max() < 0.5
    at = along(track)
    straight = (at > 420.0) & (at < 900.0)
    assert np.abs(track.table[straight, CURVATURE]).max() < 0.002
    assert track.table[:, CURVATURE].max() == pytest.approx(1.0 / 20.0, rel=0.25)
    assert len([s for s in track.sections if s.kind == "corner"]) == 2


def test_parts_that_lie_close_share_the_space_between(tmp_path: Path) -> None:
    # The straights lie 24 m apart, with 12 m of grass between their inner edges.
    track = imported(tmp_path, path_of(stadium(radius=12.0)), left=6.0)
    at, table = along(track), track.table
    straight = (at > 450.0) & (at < 800.0)
    assert (table[straight, WALL_LEFT] < 12.0).all()
    assert (table[straight, WALL_LEFT] - table[straight, LEFT] > 3.0).all()
    assert_walls_stand_clear(track)


waves = st.lists(st.tuples(st.floats(-0.15, 0.15), st.floats(0.0, 6.28)), min_size=4, max_size=4)


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(waves, st.floats(2.0, 7.0), st.floats(2.0, 7.0), st.sampled_from([1.0, -1.0]))
def test_any_road_becomes_a_circuit_that_can_be_read_and_raced(
    tmp_path_factory: pytest.TempPathFactory,
    waves: list[tuple[float, float]],
    right: float,
    left: float,
    way: float,
) -> None:
    angle = way * np.linspace(0.0, 2 * np.pi, 500, endpoint=False)
    size = 300.0 * np.exp(sum(a * np.cos(k * angle + b) for k, (a, b) in enumerate(waves, start=2)))
    folder = tmp_path_factory.mktemp("any")
    track = imported(folder, np.stack([size * np.cos(angle), size * np.sin(angle)], axis=1), right, left)
    facts = facts_of(folder)
    assert_walls_stand_clear(track)
    table, at = track.table, along(track)
    last = track.grid.pole_m - 19 * track.grid.spacing_m
    grid = np.flatnonzero(at >= track.length + last)
    assert track.grid.lateral_m + 1.0 <= table[grid][:, [LEFT, RIGHT]].min()
    for zone in facts.penalty_zone:
        assert 99.0 <= zone.end_m - zone.start_m <= 251.0
    for kerb in facts.kerb:
        assert kerb.end_m <= track.length + 0.1
    for section in facts.section:
        assert section.start_m < section.end_m <= track.length + 0.1
    turned = float(table[:, CURVATURE].sum() * track.spacing)
    assert turned == pytest.approx(way * 2 * np.pi, rel=1e-3)


def test_a_bend_across_the_line_is_two_sections(tmp_path: Path) -> None:
    angle = np.linspace(0.0, 2 * np.pi, 250, endpoint=False)
    imported(tmp_path, 200.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    (section,) = facts_of(tmp_path).section
    assert (section.name, section.start_m) == ("Turn 1", 0.0)


def test_the_same_file_gives_the_same_bytes(tmp_path: Path) -> None:
    source = write_line(tmp_path / "line.csv", path_of(stadium()))
    one, other = (import_circuit(source, "same", tmp_path / folder).path for folder in ("one", "other"))
    for file in ("circuit.toml", "centre_line.csv"):
        assert (one.parent / file).read_bytes() == (other.parent / file).read_bytes()


def test_a_first_point_repeated_at_the_end_is_left_out(tmp_path: Path) -> None:
    points = path_of(stadium())
    (tmp_path / "once").mkdir()
    once = imported(tmp_path / "once", points)
    again = imported(tmp_path, np.vstack([points, points[:1]]))
    np.testing.assert_array_equal(once.table, again.table)


def test_the_inner_edge_of_a_hairpin_keeps_its_distance_from_the_middle_of_the_bend(tmp_path: Path) -> None:
    # The edge is a circle of 1.2 m; the straights beside it lie 2.4 m apart.
    track = imported(tmp_path, path_of(stadium(radius=10.0)), left=8.8)
    at, table = along(track), track.table
    bend = (at > 310.0) & (at < 320.0)
    assert (table[bend, LEFT] * table[bend, CURVATURE]).max() < 0.88
    assert (table[:, LEFT] >= 8.8 - 2.0).all()
    straight = (at > 400.0) & (at < 850.0)
    np.testing.assert_allclose(table[straight, LEFT], 8.8)
    np.testing.assert_allclose(table[:, RIGHT], 5.0)
    assert_walls_stand_clear(track)


def flat_eight() -> NDArray[np.float64]:
    """Its branches cross at 23 degrees."""
    angle = np.linspace(0.0, 2 * np.pi, 300, endpoint=False)
    return np.stack([900.0 * np.sin(angle), 90.0 * np.sin(2 * angle)], axis=1)


def pinched() -> NDArray[np.float64]:
    """An oval whose sides come as near as 20 m."""
    angle = np.linspace(0.0, 2 * np.pi, 300, endpoint=False)
    return np.stack([300.0 * np.cos(angle), 100.0 * np.sin(angle) * (0.1 + np.cos(angle) ** 2)], axis=1)


def spiked() -> NDArray[np.float64]:
    points = path_of(stadium())
    points[20, 1] += 4.0
    return points


SHAPES: dict[str, tuple[Callable[[], NDArray[np.float64]], float, str]] = {
    "crosses itself at a small angle": (flat_eight, 5.0, "cross, .* bridges, at 30 degrees or more"),
    "edge folds over in a bend": (lambda: path_of(stadium(radius=12.0)), 12.5, "cross"),
    "parts overlap": (pinched, 11.0, "cross"),
    "open": (lambda: path_of(stadium())[:-10], 5.0, "expected a closed line"),
    "gap": (lambda: np.delete(path_of(stadium()), range(30, 60), axis=0), 5.0, "expected at most 50 m"),
    "few points": (lambda: path_of(stadium(), 100.0), 5.0, "17 points, expected at least 20"),
    "small": (lambda: path_of(stadium()) / 10, 5.0, "expected 300 to 30000 m: --scale 10"),
    "turns back": (lambda: path_of(stadium())[np.r_[0:50, 45:340]], 5.0, "expected them in driving order"),
    "spike": (spiked, 5.0, "bends with a radius|cross"),
    "narrow": (lambda: path_of(stadium()), 1.9, "expected a road at least 4 m wide"),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_roads_that_no_car_could_race_on_are_refused(tmp_path: Path, shape: str) -> None:
    points, width, complaint = SHAPES[shape]
    with pytest.raises(InputError, match=complaint):
        imported(tmp_path, points(), width, width)
    assert not (tmp_path / "circuits").exists()


@pytest.mark.parametrize(
    ("line", "text", "complaint"),
    [
        (1, "a,b,c,d", "line 2: expected columns named x_m and y_m"),
        (7, "1.0,2.0,5.0", "line 7: 3 columns, expected x_m,y_m,w_tr_right_m,w_tr_left_m"),
        (7, "1.0,2.0,5.0,6.0,0.0", "line 7: 5 columns"),
        (7, "25.0,0.0,wide,6.0", "line 7: w_tr_right_m is 'wide', expected a number"),
        (7, "25.0,nan,5.0,6.0", "line 7: y_m is 'nan'"),
        (7, "25.0,0.0,5.0,inf", "line 7: w_tr_left_m is 'inf'"),
        (7, "1e300,0.0,5.0,6.0", "line 7: x_m is '1e300'"),
        (7, "25.0,0.0,-5.0,6.0", "line 7: w_tr_right_m is -5, expected a positive distance"),
        (7, "25.0,0.0,5.0,0.0", "line 7: w_tr_left_m is 0, expected a positive distance"),
    ],
)
def test_a_faulty_line_is_named_with_the_field(tmp_path: Path, line: int, text: str, complaint: str) -> None:
    source = write_line(tmp_path / "line.csv", path_of(stadium()))
    lines = source.read_text("utf-8").splitlines()
    lines[line - 1] = text
    source.write_text("\n".join(lines), "utf-8")
    with pytest.raises(InputError, match=f"line.csv: {complaint}"):
        import_circuit(source, "faulty", tmp_path)
    assert list(tmp_path.iterdir()) == [source]


@pytest.mark.parametrize(
    "content", [b"", b"\x89PNG\r\n\x1a\n\x00\xff", b"# x_m,y_m,w_tr_right_m,w_tr_left_m\n"]
)
def test_a_file_of_another_kind_is_refused(tmp_path: Path, content: bytes) -> None:
    source = tmp_path / "line.csv"
    source.write_bytes(content)
    with pytest.raises(InputError, match=r"line.csv: .*expected"):
        import_circuit(source, "other", tmp_path)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none.csv: cannot read the centre line: No such file"):
        import_circuit(tmp_path / "none.csv", "none", tmp_path)
    with pytest.raises(InputError, match="cannot read the centre line: Is a directory"):
        import_circuit(tmp_path, "none", tmp_path)


@pytest.mark.parametrize("name", ["", "Nord", "../up", "a_b", "-a", "a--b", "a b", "ä", "a/b", "a\n"])
def test_only_plain_names_are_taken(tmp_path: Path, name: str) -> None:
    source = write_line(tmp_path / "line.csv", path_of(stadium()))
    with pytest.raises(InputError, match=r"--name: .*expected lowercase letters"):
        import_circuit(source, name, tmp_path)


def test_nothing_that_is_there_is_overwritten(tmp_path: Path) -> None:
    source = write_line(tmp_path / "line.csv", path_of(stadium()))
    (tmp_path / "mine").mkdir()
    with pytest.raises(InputError, match="mine: is there already"):
        import_circuit(source, "mine", tmp_path)
    assert not list((tmp_path / "mine").iterdir())


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    source = write_line(tmp_path / "line.csv", path_of(stadium()))
    with pytest.raises(InputError, match="the circuit cannot be written: "):
        import_circuit(source, "new", source)
