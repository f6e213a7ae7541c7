"""A replay holds the race, as Rerun's own tools read it."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from nathlon.arena.foxglove_scene import TEAM_COLOURS
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recording import read_recording, write_recording
from nathlon.reports._countryside import countryside
from nathlon.reports._motion import gaps
from nathlon.reports.car_model import car_model
from nathlon.reports.cars import ENTRANT_COLOURS, car_colours, winner
from nathlon.reports.replay import (
    DRAUGHT_M,
    FRAMES_PER_TICK,
    MARK_COLOURS,
    open_viewer,
    race_sheet,
    write_replay,
)
from nathlon.sim.errors import InputError
from tests.support.race_logs import LAP_M, oval_outline, oval_race, road_axes, turned

RERUN = Path(sys.executable).with_name("rerun")


def rerun_rrd(*arguments: str | Path) -> str:
    done = subprocess.run([RERUN, "rrd", *arguments], capture_output=True, text=True, check=True)
    return done.stdout + done.stderr


def entities(path: Path) -> dict[str, dict[str, Any]]:
    """The columns of each entity of a replay; static ones and those in time together."""
    found: dict[str, dict[str, Any]] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        found.setdefault(chunk.entity_path, {}).update(zip(batch.schema.names, batch.columns, strict=True))
    return found


@pytest.fixture(scope="module")
def log() -> RaceLog:
    return oval_race(cars=3, duration_s=20.0)


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory, log: RaceLog) -> Path:
    path = tmp_path_factory.mktemp("replay") / "race.rrd"
    write_replay(log, path)
    return path


def test_rerun_verifies_the_file_and_finds_all_entities(replay: Path, log: RaceLog) -> None:
    assert "verified without error" in rerun_rrd("verify", replay)
    stats = rerun_rrd("stats", replay)
    circuit = ["country", "edges", "gravel", "grass", "kerb_0", "kerb_1", "line", "road"]
    circuit += [f"wall_{side}/{panel}" for side in ("left", "right") for panel in (0, 1)]
    wanted = [f"/world/circuit/{part}" for part in circuit]
    wanted += ["/race", "/incidents/contact", "/incidents/ending", "/map/incidents/contact"]
    for car in range(len(log.names)):
        wanted += [f"/world/cars/{car}", f"/world/cars/{car}/body", f"/map/cars/{car}", f"/map/trails/{car}"]
        wanted += [
            f"/series/{name}/{car}" for name in ("speed", "throttle", "brake", "steering", "place", "gap")
        ]
    wanted += [f"/{what}/contact" for what in ("world/incidents", "series/incidents", "series/standings")]
    for entity in wanted:
        assert f"\n{entity}: " in stats, entity
    assert [path.name for path in replay.parent.iterdir()] == ["race.rrd"]


def test_it_carries_its_own_layout(replay: Path) -> None:
    (recording,), (blueprint,) = RrdReader(replay).recordings(), RrdReader(replay).blueprints()
    assert (recording.application_id, recording.recording_id) == ("nathlon", "0123456789abcdef-3")
    assert blueprint.application_id == "nathlon"


def test_it_has_the_name_of_its_race(replay: Path) -> None:
    [name] = entities(replay)["/__properties"]["RecordingInfo:name"].to_pylist()
    assert name == ["oval, race 3 of match 0123456789"]


def test_poses_are_those_of_the_log(replay: Path, log: RaceLog) -> None:
    columns = entities(replay)["/world/cars/1"]
    translation = np.array([row[0] for row in columns["Transform3D:translation"].to_pylist()])
    quaternion = np.array([row[0] for row in columns["Transform3D:quaternion"].to_pylist()])
    time_s = columns["race_time"].to_numpy() / np.timedelta64(1, "s")
    sample = log.samples[:, 1]
    at_ticks = slice(None, None, FRAMES_PER_TICK)

    np.testing.assert_allclose(time_s[at_ticks], log.time_s, atol=1e-8)
    np.testing.assert_allclose(translation[at_ticks, 0], sample["x_m"], atol=1e-3)
    np.testing.assert_allclose(translation[at_ticks, 1], sample["y_m"], atol=1e-3)
    np.testing.assert_allclose(translation[at_ticks, 2], sample["z_m"], atol=1e-3)
    along, up = road_axes(sample["distance_m"], sample["yaw_rad"])
    nose = turned(quaternion, (1.0, 0.0, 0.0))
    np.testing.assert_allclose(nose[at_ticks], along, atol=1e-5)
    np.testing.assert_allclose(turned(quaternion, (0.0, 0.0, 1.0))[at_ticks], up, atol=1e-5)
    turns = np.linalg.norm(np.diff(nose, axis=0), axis=1)
    assert turns.max() < 0.05, "the car spins between two samples"


def test_north_is_up_on_the_map(replay: Path, log: RaceLog) -> None:
    positions = entities(replay)["/map/cars/0"]["Points2D:positions"].to_pylist()
    np.testing.assert_allclose(
        positions[-1][0], [log.samples["x_m"][-1, 0], -log.samples["y_m"][-1, 0]], rtol=1e-6
    )


def test_series_and_incidents_are_those_of_the_log(replay: Path, log: RaceLog) -> None:
    found = entities(replay)
    speed = [row[0] for row in found["/series/speed/2"]["Scalars:scalars"].to_pylist()]
    driven = log.samples[log.samples["driving"][:, 2], 2]
    assert 0 < len(driven) < len(log.time_s)
    np.testing.assert_allclose(speed, 3.6 * driven["velocity_x_m_s"], rtol=1e-6)
    place = [row[0] for row in found["/series/place/2"]["Scalars:scalars"].to_pylist()]
    np.testing.assert_array_equal(place, -log.samples["place"][:, 2])
    assert found["/incidents/contact"]["TextLog:text"].to_pylist() == [[log.incidents[0].text]]
    assert found["/incidents/ending"]["race_time"].to_numpy() == np.timedelta64(10, "s")
    mark = found["/map/incidents/ending"]["Points2D:positions"].to_pylist()[0][0]
    stopped = log.samples[-1, 2]
    np.testing.assert_allclose(mark, [stopped["x_m"], -stopped["y_m"]], rtol=1e-6)


def test_slipstream_zones_and_incidents_are_drawn(replay: Path, log: RaceLog) -> None:
    found = entities(replay)
    strips = found["/world/cars/1/draught"]["LineStrips3D:strips"].to_pylist()
    assert [len(drawn) for drawn in strips] == [6] * len(log.time_s)
    roots, tips = np.array(strips[5])[:, 0], np.array(strips[5])[:, 1]
    np.testing.assert_allclose(tips - roots, [[DRAUGHT_M * 0.4, 0.0, 0.0]] * 6, atol=1e-5)
    np.testing.assert_allclose(roots[:, 0], log.car_length_m / 2)
    assert (np.abs(roots[:, 1]) < log.car_width_m / 2).all()
    alone = found["/world/cars/0/draught"]["LineStrips3D:strips"].to_pylist()
    assert [len(drawn) for drawn in alone] == [0] * len(log.time_s)

    drawn = np.array(found["/map/circuit/zones"]["LineStrips2D:strips"].to_pylist()[0])
    rows = np.flatnonzero(log.outline.zone)
    np.testing.assert_allclose(drawn[:, 0], log.outline.centre[rows, :2] * [1.0, -1.0], rtol=1e-6)
    assert len(found["/world/circuit/zones"]["LineStrips3D:strips"].to_pylist()[0]) == 2 * len(rows)
    tick = round(log.incidents[0].time_s * 10 + 0.5)
    touched = log.samples[tick, 0]
    mark = found["/world/incidents/contact"]["Points3D:positions"].to_pylist()[0][0]
    np.testing.assert_allclose(mark[:2], [touched["x_m"], touched["y_m"]], rtol=1e-5)
    speed = found["/series/incidents/contact"]["Scalars:scalars"].to_pylist()[0][0]
    assert speed == pytest.approx(3.6 * touched["velocity_x_m_s"], rel=1e-5)
    standing = found["/series/standings/contact"]["Scalars:scalars"].to_pylist()[0][0]
    assert standing == -touched["place"]
    colour = found["/incidents/contact"]["TextLog:color"].to_pylist()[0][0]
    assert colour == int.from_bytes([*MARK_COLOURS["contact"], 255])


def test_a_gap_is_the_time_since_the_first_was_there(replay: Path, log: RaceLog) -> None:
    columns = entities(replay)["/series/gap/1"]
    gap_s = -np.array([row[0] for row in columns["Scalars:scalars"].to_pylist()])
    time_s = columns["race_time"].to_numpy() / np.timedelta64(1, "s")
    # Nobody overtakes here, and car 1 starts 9 m behind car 0.
    first, second = (log.samples["distance_m"][:, car] for car in (0, 1))
    there = np.interp(second, first, log.time_s)
    known = second >= first[0]
    np.testing.assert_allclose(time_s, log.time_s[known])
    np.testing.assert_allclose(gap_s, (log.time_s - there)[known], atol=0.02)
    assert gap_s.min() > 0.0


def test_gaps_are_known_while_a_car_drives(log: RaceLog) -> None:
    found = gaps(log)
    assert (found[:, 0] == 0.0).all()
    assert np.isnan(found[~log.samples["driving"]]).all()
    assert np.isnan(found[0, 1:]).all()


def test_the_camera_follows_the_winner_or_the_car_asked_for(
    replay: Path, log: RaceLog, tmp_path: Path
) -> None:
    assert winner(log) == 0
    assert "/world/cars/0/chase" in entities(replay)
    write_replay(log, tmp_path / "other.rrd", follow=2)
    assert [path for path in entities(tmp_path / "other.rrd") if "chase" in path] == ["/world/cars/2/chase"]


def test_two_writings_compare_equal(replay: Path, log: RaceLog, tmp_path: Path) -> None:
    write_recording(tmp_path / "race.mcap", log)
    write_replay(read_recording(tmp_path / "race.mcap"), tmp_path / "again.rrd")
    rerun_rrd("compare", "--unordered", replay, tmp_path / "again.rrd")
    write_replay(replace(log, names=("x", "y", "z")), tmp_path / "other.rrd")
    with pytest.raises(subprocess.CalledProcessError):
        rerun_rrd("compare", "--unordered", replay, tmp_path / "other.rrd")


@pytest.mark.parametrize("ticks", [0, 1, 2])
def test_the_shortest_races_can_be_shown(tmp_path: Path, ticks: int, log: RaceLog) -> None:
    short = replace(
        log, time_s=log.time_s[:ticks], samples=log.samples[:ticks], incidents=(), teams=(-1, -1, -1)
    )
    write_replay(short, tmp_path / "short.rrd")
    assert "verified without error" in rerun_rrd("verify", tmp_path / "short.rrd")
    assert ("/world/cars/0" in entities(tmp_path / "short.rrd")) == (ticks > 0)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a window would open")
def test_without_a_display_the_viewer_says_why(replay: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(variable, raising=False)
    with pytest.raises(InputError, match=r"race\.rrd cannot be shown, .*DISPLAY"):
        open_viewer(replay)


def test_the_race_sheet_lists_cars_by_place(log: RaceLog) -> None:
    last = log.samples.copy()
    last["place"][-1] = [2, 1, 3]
    rows = [line for line in race_sheet(replace(log, samples=last)).splitlines() if "entrant" in line]
    assert [row.split(" | ")[1] for row in rows] == ["2 entrant b", "1 entrant a", "3 entrant a"]


def test_cars_of_a_team_differ_in_shade_only(log: RaceLog) -> None:
    colours = car_colours(replace(log, teams=(0, 1, 0, -1), names=("a", "b", "a", "c")))
    assert colours[0] == TEAM_COLOURS[0]
    assert colours[1] == TEAM_COLOURS[1]
    assert len(set(colours)) == 4
    assert colours[2][2] == max(colours[2]), "a lighter blue is still blue"


def test_without_teams_cars_of_an_entrant_differ_in_shade_only(log: RaceLog) -> None:
    names = tuple("abacdefghij")
    colours = car_colours(replace(log, teams=(-1,) * len(names), names=names))
    assert colours[:2] == list(ENTRANT_COLOURS[:2])
    assert len(set(colours)) == len(names)
    assert all(part > strong for part, strong in zip(colours[2], ENTRANT_COLOURS[0], strict=True))


def test_the_country_meets_the_walls_and_leaves_the_circuit_free() -> None:
    outline = oval_outline()
    vertices, triangles = countryside(outline)
    walls = {tuple(point) for point in np.concatenate([outline.wall_left, outline.wall_right])}
    assert walls <= {tuple(point) for point in vertices[triangles.ravel()]}
    a, b, c = (vertices[triangles[:, k], :2] for k in range(3))
    (bx, by), (cx, cy) = (b - a).T, (c - a).T
    area = np.abs(bx * cy - by * cx).sum() / 2
    whole = np.prod(np.ptp(vertices[:, :2], axis=0))
    assert whole - area == pytest.approx(20.0 * LAP_M, rel=0.01)


def test_the_car_model_fills_the_cars_size() -> None:
    vertices, triangles, colours = car_model(4.6, 1.95, (200, 100, 50))
    np.testing.assert_allclose(np.ptp(vertices[:, :2], axis=0), [4.6, 1.95], atol=0.02)
    assert vertices[:, 2].min() == 0.0
    assert triangles.max() < len(vertices) == len(colours)
    centre = vertices[triangles[:, 0]]
    normal = np.cross(vertices[triangles[:, 1]] - centre, vertices[triangles[:, 2]] - centre)
    assert (np.linalg.norm(normal, axis=1) > 0).all()
