"""Generated circuits: closed, apart from themselves, driveable, different, and always the same."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from nathlon.sim.errors import InputError
from nathlon.sim.track import (
    BANK,
    CREST,
    CURVATURE,
    KERB_LEFT,
    KERB_RIGHT,
    LEFT,
    RIGHT,
    SLOPE,
    TWIST,
    WALL_LEFT,
    WALL_RIGHT,
    Track,
    X,
    Y,
    Z,
    read_track,
)
from nathlon.sim.track.crossing import find_crossings, meetings
from nathlon.sim.track.generating import generate_circuit, generate_track, write_generated
from nathlon.sim.track.styles import STYLES

SEEDS = range(4)
each_circuit = pytest.mark.parametrize(
    ("style", "seed"), [(style, seed) for style in STYLES for seed in SEEDS]
)
generated = cache(generate_track)


def meet(track: Track, left: float | np.ndarray, right: float | np.ndarray) -> int:
    """How often two lines beside the centre line cross themselves and each other."""
    lines = [track.offset_line(left)[:, :2], track.offset_line(-np.asarray(right))[:, :2]]
    ends = [np.roll(line, -1, axis=0) for line in lines]
    return len(meetings(np.concatenate(lines), np.concatenate(ends)))


@each_circuit
def test_the_lap_closes_after_one_turn_and_meets_itself_nowhere(style: str, seed: int) -> None:
    track = generated(seed, style)
    table = track.table
    assert abs(table[:, CURVATURE].sum() * track.spacing) == pytest.approx(2 * np.pi, rel=5e-3)
    steps = np.hypot(*(np.roll(table[:, [X, Y]], -1, axis=0) - table[:, [X, Y]]).T)
    np.testing.assert_allclose(steps, track.spacing, rtol=0.01)
    assert find_crossings(table[:, [X, Y]]) == []
    assert meet(track, table[:, LEFT], table[:, RIGHT]) == 0
    assert meet(track, table[:, WALL_LEFT], table[:, WALL_RIGHT]) == 0


@each_circuit
def test_cars_can_follow_the_road(style: str, seed: int) -> None:
    track = generated(seed, style)
    table = track.table
    bend = np.abs(table[:, CURVATURE])
    assert bend.max() < 1.0 / 9.0
    # On the clothoids of the tightest bends, curvature grows from nothing within some metres.
    assert np.abs(np.diff(bend)).max() / track.spacing < 0.02
    assert np.abs(table[:, SLOPE]).max() < 0.095
    assert np.abs(table[:, TWIST]).max() < 0.004
    # No crest lifts a car at the speed of its bend, or at 85 m/s.
    speed_squared = np.minimum(85.0**2, 30.0 / np.maximum(bend, 1e-9))
    assert (np.abs(table[:, CREST]) * speed_squared).max() < 7.5
    assert table[0, Z] == 0.0


@each_circuit
def test_the_grid_stands_on_a_straight_within_the_road(style: str, seed: int) -> None:
    track = generated(seed, style)
    back = round((19 * track.grid.spacing_m - track.grid.pole_m + 5.0) / track.spacing)
    behind = track.table[-back:]
    assert np.abs(behind[:, CURVATURE]).max() < 2e-3
    assert behind[:, [LEFT, RIGHT]].min() > track.grid.lateral_m + 1.0
    ahead = track.table[: round(50.0 / track.spacing)]
    assert np.abs(ahead[:, CURVATURE]).max() < 2e-3


@each_circuit
def test_tight_bends_have_a_kerb_inside_where_walls_leave_room(style: str, seed: int) -> None:
    track, beside = generated(seed, style), STYLES[style].roadside
    table = track.table
    room = beside.kerb_m + beside.beside_kerb_m + 0.1
    for side, edge, wall, kerb in (
        (1.0, LEFT, WALL_LEFT, KERB_LEFT),
        (-1.0, RIGHT, WALL_RIGHT, KERB_RIGHT),
    ):
        apex = (side * table[:, CURVATURE] > 1.0 / 40.0) & (table[:, wall] - table[:, edge] > room)
        if apex.sum() > 20:
            assert (table[apex, kerb] > 0.0).mean() > 0.6


@each_circuit
def test_bends_lean_more_to_the_inside_than_to_the_outside(style: str, seed: int) -> None:
    table = generated(seed, style).table
    bank = np.degrees(np.arctan(table[:, BANK]))
    assert np.abs(bank).max() < 12.5
    if style != "street":
        assert (bank * np.sign(table[:, CURVATURE])).sum() < 0.0  # a left bend has its left side down


@pytest.mark.parametrize("style", STYLES)
def test_files_give_the_track_that_needs_none(tmp_path: Path, style: str) -> None:
    path = write_generated(tmp_path, 5, style)
    assert path == tmp_path / f"{style}-5" / "circuit.toml"
    written, made = read_track(path), generated(5, style)
    np.testing.assert_array_equal(written.table, made.table)
    assert (written.sections, written.grid, written.sectors) == (made.sections, made.grid, made.sectors)


def test_a_seed_gives_the_same_bytes_and_another_one_another_circuit(tmp_path: Path) -> None:
    one, again = (write_generated(tmp_path / folder, 3, "street").parent for folder in ("one", "again"))
    for file in ("circuit.toml", "centre_line.csv"):
        assert (one / file).read_bytes() == (again / file).read_bytes()
    first, second = generated(3, "street"), generated(2, "street")
    assert first.length != second.length


def test_styles_differ_in_width_walls_and_radius() -> None:
    def mean(style: str, column: int) -> float:
        return float(np.mean([generated(seed, style).table[:, column].mean() for seed in SEEDS]))

    def beyond(style: str) -> float:
        return mean(style, WALL_RIGHT) - mean(style, RIGHT)

    def sharp(style: str) -> float:
        bends = np.concatenate([np.abs(generated(seed, style).table[:, CURVATURE]) for seed in SEEDS])
        return float(np.quantile(bends[bends > 1.0 / 400.0], 0.9))

    assert mean("grand-prix", LEFT) > mean("national", LEFT)
    assert beyond("grand-prix") > beyond("national") > beyond("street")
    assert beyond("street") < 3.0
    assert sharp("street") > sharp("national") > sharp("grand-prix")


@pytest.mark.parametrize("length", [1500.0, 2502.0, 7000.0])
def test_the_lap_is_as_long_as_asked(length: float) -> None:
    assert generate_track(1, "national", length).length == pytest.approx(length, abs=3.0)


@pytest.mark.parametrize(
    ("style", "length", "said"),
    [
        ("rally", None, r"--style: 'rally', expected one of grand-prix, street, national"),
        ("street", 10.0, r"--length: 10, expected a lap of 1,500 to 10,000 metres"),
        ("street", float("nan"), r"--length: nan, expected a lap of"),
    ],
)
def test_wrong_input_is_one_sentence(style: str, length: float | None, said: str) -> None:
    with pytest.raises(InputError, match=said):
        generate_circuit(1, style, length)


def test_a_folder_that_is_there_stays_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "street-1").mkdir()
    with pytest.raises(InputError, match=r"street-1: is there already"):
        write_generated(tmp_path, 1, "street")
    assert list((tmp_path / "street-1").iterdir()) == []
