"""Files of every dialect give the circuit that they describe; what cannot be one is refused in a sentence."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from nathlon.sim.errors import InputError
from nathlon.sim.track import BANK, LEFT, RIGHT, Track, X, Y, Z, read_track
from nathlon.sim.track.collection import import_folder, name_of
from nathlon.sim.track.formats.outline import MOST_POINTS
from nathlon.sim.track.formats.reading import read_outline
from nathlon.sim.track.importing import Imported, import_circuit
from nathlon.sim.track.lap_line import lap_line
from nathlon.sim.track.projection import transverse_mercator
from tests.support import circuit_dialects as dialects


def imported(
    folder: Path, content: bytes | str, width: float | None = None, scale: float = 1.0
) -> tuple[Imported, Track]:
    source = folder / "circuit.dat"
    source.write_bytes(content if isinstance(content, bytes) else content.encode())
    made = import_circuit(source, "made", folder, width, scale)
    return made, read_track(made.path)


def area(track: Track) -> float:
    x, y = track.table[:, [X, Y]].T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


@pytest.mark.parametrize("dialect", dialects.DIALECTS)
def test_every_dialect_gives_the_same_circuit(tmp_path: Path, dialect: str) -> None:
    make, knows_widths, knows_heights = dialects.DIALECTS[dialect]
    made, track = imported(tmp_path, make())
    # Points of maps are smoothed by a metre, which cuts the ends of the bends.
    assert track.length == pytest.approx(dialects.LENGTH, rel=0.005)
    assert area(track) == pytest.approx(dialects.AREA, rel=0.015)
    width = track.table[:, LEFT] + track.table[:, RIGHT]
    if knows_widths:
        assert width.mean() == pytest.approx(dialects.RIGHT + dialects.LEFT, abs=0.15)
        assert np.abs(width - width.mean()).max() < 0.6
        assert not any("guess" in note for note in made.notes)
    else:
        np.testing.assert_allclose(width, 10.0)
        assert any("guess" in note for note in made.notes)
    assert np.ptp(track.table[:, Z]) == pytest.approx(dialects.RELIEF if knows_heights else 0.0, abs=0.35)


def test_banking_of_a_left_bend_lifts_its_right_side(tmp_path: Path) -> None:
    _, track = imported(tmp_path, dialects.torcs())
    assert track.table[:, BANK].min() == pytest.approx(np.tan(np.radians(-5.0)), rel=0.05)


def test_what_is_converted_is_said(tmp_path: Path) -> None:
    for dialect, word in (
        ("tabs", "moved to its first point"),
        ("kilometres", "km made metres"),
        ("degree table", "degrees made metres"),
        ("unnamed", "no column names"),
        ("fast_lane.ai", "moved to the middle"),
    ):
        (tmp_path / "file").write_bytes(dialects.DIALECTS[dialect][0]())
        assert word in "; ".join(lap_line(read_outline(tmp_path / "file")).notes)


def test_units_without_names_follow_from_the_length_of_the_lap(tmp_path: Path) -> None:
    line = dialects.centre()
    for points, word in ((line / 1000.0, "kilometres"), (dialects.degrees(line), "degrees"), (line, "")):
        (tmp_path / "file").write_text("\n".join(f"{x:.9f},{y:.9f}" for x, y in points), "utf-8")
        lap = lap_line(read_outline(tmp_path / "file"))
        assert word in "; ".join(lap.notes)
        assert np.ptp(lap.points[:, 0]) == pytest.approx(np.ptp(line[:, 0]), rel=1e-3)


def test_width_and_scale_are_as_asked_for(tmp_path: Path) -> None:
    content = dialects.database().decode()
    rows = [[float(cell) / 10.0 for cell in row.split(",")] for row in content.splitlines()[1:]]
    small = "x,y,w_right,w_left\n" + "\n".join(",".join(f"{cell:.5f}" for cell in row) for row in rows)
    with pytest.raises(InputError, match="--scale 10"):
        imported(tmp_path, small)
    _, track = imported(tmp_path, small, width=9.0, scale=10.0)
    assert track.length == pytest.approx(dialects.LENGTH, rel=0.003)
    np.testing.assert_allclose(track.table[:, LEFT] + track.table[:, RIGHT], 9.0)


def test_a_receivers_second_and_third_lap_are_left_out(tmp_path: Path) -> None:
    made, track = imported(tmp_path, dialects.gpx(laps=3))
    assert track.length == pytest.approx(dialects.LENGTH, rel=0.005)
    assert "the first of several laps" in made.notes


def test_a_small_gap_is_closed_and_said(tmp_path: Path) -> None:
    line = dialects.centre()[:-5]
    made, track = imported(tmp_path, "x_m,y_m\n" + "\n".join(f"{x:.4f},{y:.4f}" for x, y in line))
    assert track.length == pytest.approx(dialects.LENGTH, rel=0.003)
    assert "the last point lies 30.1 m from the first: joined" in made.notes


def test_straights_without_points_stay_straight(tmp_path: Path) -> None:
    line = dialects.centre()
    bends = line[np.abs(line[:, 0]) > dialects.STRAIGHT / 2 - 0.1][::3]
    ring = [[float(x), float(y)] for x, y in dialects.degrees(np.vstack([bends, bends[:1]]))]
    _, track = imported(tmp_path, json.dumps({"type": "Polygon", "coordinates": [ring]}))
    assert track.length == pytest.approx(dialects.LENGTH, rel=0.005)
    across = np.ptp(track.table[:, Y])
    assert across == pytest.approx(2 * dialects.RADIUS, abs=2.5)


def test_two_files_of_edges_are_one_circuit(tmp_path: Path) -> None:
    for side, offset in (("left", dialects.LEFT), ("right", -dialects.RIGHT)):
        (tmp_path / f"oval_{side}.kml").write_bytes(dialects.kml(edge=dialects.edge(offset)))
    (tried,) = import_folder(tmp_path, tmp_path / "out")
    assert tried.imported is not None
    track = read_track(tried.imported.path)
    assert track.length == pytest.approx(dialects.LENGTH, rel=0.005)
    assert (track.table[:, LEFT] + track.table[:, RIGHT]).mean() == pytest.approx(11.0, abs=0.15)


def test_a_folder_is_imported_but_for_what_is_no_circuit(tmp_path: Path) -> None:
    for name in ("A Track.csv", "sub/a-track.geojson", "sub/notes.txt", "picture.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"nothing")
    (tmp_path / "A Track.csv").write_bytes(dialects.database())
    (tmp_path / "sub/a-track.geojson").write_bytes(dialects.geojson())
    told: list[str] = []
    tried = import_folder(tmp_path, tmp_path / "out", tell=lambda one: told.append(one.file.name))
    assert told == ["A Track.csv", "a-track.geojson", "notes.txt"]
    assert [one.imported.path.parent.name if one.imported else "" for one in tried] == [
        "a-track",
        "a-track-2",
        "",
    ]
    assert "expected columns named" in tried[2].refusal
    assert name_of(Path("Spa-Francorchamps (GP) 2019.csv")) == "spa-francorchamps-gp-2019"


def test_places_are_projected_as_surveyors_do() -> None:
    # The CN Tower in zone 17 of UTM, whose meridian lies at 81 degrees west.
    tower = np.array([[-(79 + 23 / 60 + 13.7 / 3600), 43 + 38 / 60 + 33.24 / 3600]])
    east, north = 0.9996 * transverse_mercator(tower, -81.0)[0]
    assert (east + 500_000.0, north) == (
        pytest.approx(630_084.0, abs=1.0),
        pytest.approx(4_833_438.0, abs=1.0),
    )
    south = transverse_mercator(tower * [1.0, -1.0], -81.0)[0]
    assert south[1] == pytest.approx(-north / 0.9996)


LAUGHS = '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]><gpx>&b;</gpx>'
REFUSED: dict[str, tuple[bytes | str, str]] = {
    "laughs": (LAUGHS, "the entity 'a' is declared"),
    "deep": ("<gpx>" * 100, "at most .* 64 deep"),
    "cut": (dialects.gpx()[:-20], "not well-formed XML"),
    "other XML": ("<html><body/></html>", "XML of <html>, expected a table, GeoJSON"),
    "nested JSON": ("[" * 100_000, "not JSON"),
    "no line": ('{"type": "Point", "coordinates": [1, 2]}', "expected GeoJSON with a LineString"),
    "archive": (b"PK\x03\x04rest", "an archive"),
    "two circuits": (
        dialects.kml(one=dialects.edge(0.0), other=dialects.edge(0.0) + np.array([5000.0, 0.0])),
        "2 closed lines, expected one circuit",
    ),
    "open segments": (
        dialects.torcs().replace(b'val="180.0"', b'val="90.0"', 1),
        "expected segments that lead round",
    ),
    "turn unknown": (dialects.torcs().replace(b'val="lft"', b'val="up"', 1), "type is 'up', expected one of"),
    "longitude": (dialects.gpx().replace(b'lon="11.', b'lon="east', 1), "line 1: longitude is 'east"),
    "arrays": (dialects.fastest_lap().replace(b"<nl>6.00000, ", b"<nl>"), "nl has .* numbers, expected"),
    "lanelets": (
        dialects.commonroad().replace(b'ref="0"', b'ref="9"'),
        "expected lanelets that follow each other",
    ),
    "cut lane": (dialects.fast_lane()[:3000], "expected 5,016 for 250 points"),
    "mixed decimals": ("x;y\n1,5;2.5\n1,5;2,5\n", "decimal commas and decimal points are mixed"),
    "too many": ("x,y\n" + "1,2\n" * (MOST_POINTS + 1), "expected at most 100,000"),
    "crowd": (",".join(["1"] * 6) + "\n", "6 columns without names"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_no_circuit_can_be_made_of_is_refused_in_a_sentence(tmp_path: Path, case: str) -> None:
    content, complaint = REFUSED[case]
    with pytest.raises(InputError, match=rf"circuit.dat: .*{complaint}") as said:
        imported(tmp_path, content)
    assert len(str(said.value).splitlines()) == 1
    assert [file.name for file in tmp_path.iterdir()] == ["circuit.dat"]
