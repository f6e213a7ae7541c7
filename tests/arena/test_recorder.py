"""A recorded race is the race that was run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nathlon.arena.match import BACKGROUND, TESTED, Match, Race, Seat
from nathlon.arena.race_log import RESOLUTION, RaceLog
from nathlon.arena.recorder import outline, record_races
from nathlon.arena.recording import read_recording, write_recording
from nathlon.arena.runner import run_match
from nathlon.policies.policy import Batch, Policy
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.track import KERB_LEFT, KERB_RIGHT, load_track
from tests.support.race_logs import turned

NAMES = ["slow", "quick"]


class Steady:
    """Always does the same."""

    observation_spec = ObservationSpec(course_points=4)

    def __init__(self, throttle: float) -> None:
        self._throttle = throttle

    def initial_memory(self, n: int) -> Batch:
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        actions = np.zeros((len(observations), 2), np.float32)
        actions[:, 0] = self._throttle
        return actions, memory


CHASE = '{kind = "rolling", leader_m = [50, 50], gap_m = [12, 12], lateral_m = [0, 0], speed_m_s = [40, 40]}'
POLICIES: list[Policy] = [Steady(0.3), Steady(0.9)]


def match_on(folder: Path, cars: int, facts: dict[str, str], races: int = 1) -> Match:
    """A match on lindenring of slow and quick cars in turn; facts are lines of the scenario."""
    path = folder / "scenario.toml"
    lines = {"name": '"test"', "description": '""', "cars": str(cars), "rules": '"sporting"', **facts}
    path.write_text("\n".join(f"{name} = {value}" for name, value in lines.items()))
    seats = tuple(Seat(car % 2, car % 2) for car in range(cars))
    seeds = tuple(Race(seed, seats) for seed in range(races))
    return Match("race", "test", str(path), "lindenring", "gt3", ("a", "b"), ("a", "b"), seeds)


@pytest.fixture(scope="module")
def match(tmp_path_factory: pytest.TempPathFactory) -> Match:
    """Eight cars that leave the road in the first corner and pile up there."""
    folder = tmp_path_factory.mktemp("pile")
    return match_on(folder, 8, {"time_s": "60.0", "laps": "1", "start": '{kind = "grid"}'}, races=2)


@pytest.fixture(scope="module")
def log(match: Match) -> RaceLog:
    return record_races(match, POLICIES, [1], NAMES).logs[0]


def test_it_holds_the_race_from_start_to_the_last_ending(log: RaceLog, match: Match) -> None:
    results = run_match(match, POLICIES)
    results = results.filter(results["race"] == 1).sort("car")
    assert log.names == ("slow", "quick") * 4
    assert log.samples.shape == (len(log.time_s), 8)
    assert log.time_s[0] == 0.0
    np.testing.assert_allclose(np.diff(log.time_s), 0.1)
    assert log.time_s[-1] == pytest.approx(results["driven_s"].max(), abs=0.1)
    assert log.samples["place"][-1].tolist() == results["place"].to_list()
    np.testing.assert_allclose(log.samples["distance_m"][-1], results["distance_m"].to_numpy())
    endings = [incident for incident in log.incidents if incident.kind == "ending"]
    assert {incident.cars[0] for incident in endings} == set(range(8))


def test_every_contact_and_penalty_is_among_the_incidents(log: RaceLog, match: Match) -> None:
    results = run_match(match, POLICIES)
    results = results.filter(results["race"] == 1).sort("car")
    contacts = [incident.cars for incident in log.incidents if incident.kind == "contact"]
    penalised = [incident.cars[0] for incident in log.incidents if "penalty" in incident.text]
    by_car = [sum(car in cars for cars in contacts) for car in range(8)]
    assert len(contacts) > 5
    assert by_car == results["contacts"].to_list()
    assert [penalised.count(car) for car in range(8)] == results["penalties"].to_list()
    assert sum(penalised) > 0


def test_positions_agree_with_velocities(log: RaceLog) -> None:
    """Distances between samples are what the speeds integrate to (trapezoid), until the first contact."""
    car = log.samples[:100, 1]
    moved = np.hypot(np.diff(car["x_m"]), np.diff(car["y_m"]))
    speed = np.hypot(car["velocity_x_m_s"], car["velocity_y_m_s"]).astype(float)
    np.testing.assert_allclose(moved, 0.05 * (speed[1:] + speed[:-1]), atol=0.02, rtol=0.01)


def test_cars_stand_on_the_road_as_it_lies(log: RaceLog) -> None:
    """Height and attitude agree with the plane through the nearest points of the outline."""
    lines = log.outline
    for sample in log.samples[20:110:10].ravel():
        row = int(np.argmin(np.hypot(*(lines.centre[:, :2] - [sample["x_m"], sample["y_m"]]).T)))
        along = lines.centre[(row + 1) % len(lines.centre)] - lines.centre[row - 1]
        up = np.cross(along, lines.left[row] - lines.right[row])
        up /= np.linalg.norm(up)
        at = np.array([sample["x_m"], sample["y_m"], sample["z_m"]])
        assert abs((at - lines.centre[row]) @ up) < 0.05
        angles = [sample["yaw_rad"], sample["pitch_rad"], sample["roll_rad"]]
        np.testing.assert_allclose(turned(quaternion(*angles), (0.0, 0.0, 1.0)), up, atol=0.01)


def quaternion(yaw: float, pitch: float, roll: float) -> np.ndarray:
    """x, y, z, w of the turns about z, then the new y, then the new x, from their closed form."""
    (cy, cp, cr), (sy, sp, sr) = (
        np.cos([yaw / 2, pitch / 2, roll / 2]),
        np.sin([yaw / 2, pitch / 2, roll / 2]),
    )
    return np.array(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )


@pytest.mark.parametrize(("action_hz", "sample_s"), [(10, 0.1), (15, 1 / 15), (20, 0.1), (60, 0.1)])
def test_at_any_rate_of_actions_it_samples_often_enough_and_misses_nothing(
    tmp_path: Path, action_hz: int, sample_s: float
) -> None:
    """The second of two cars runs into the first, once."""
    facts = {"time_s": "5.0", "origin": '"Lange Gerade"', "action_hz": f"{action_hz}.0", "start": CHASE}
    [log] = record_races(match_on(tmp_path, 2, facts), [Steady(0.0), Steady(1.0)], [0], NAMES).logs
    np.testing.assert_allclose(np.diff(log.time_s)[:-1], sample_s)
    assert log.time_s[-1] == pytest.approx(5.0, abs=0.1)
    (contact,) = (incident for incident in log.incidents if incident.kind == "contact")
    assert contact.cars == (1, 0)
    assert contact.text.startswith("2 quick runs into the rear of 1 slow at ")
    assert contact.text.endswith(" m/s in Lange Gerade: 6 s penalty")
    touching = log.time_s[log.samples["car_contact"].any(axis=1)][0]
    assert 0.0 <= touching - contact.time_s < sample_s + 1e-9
    before = log.samples[log.time_s < contact.time_s][-1]["velocity_x_m_s"]
    assert float(contact.text.split()[-8]) == pytest.approx(before[1] - before[0], abs=0.8)
    np.testing.assert_array_equal(
        log.samples["penalty_s"][:, 1], np.where(log.time_s > contact.time_s, 6.0, 0.0)
    )


def test_a_finish_is_told_when_the_line_is_crossed_whatever_the_penalties(tmp_path: Path) -> None:
    begin, end = load_track("lindenring").stretch("Lange Gerade")
    facts = {"time_s": "60.0", "origin": '"Lange Gerade"', "start": CHASE}
    match = match_on(tmp_path, 2, facts | {"finish_m": str(begin + 400.0 - end)})
    policies: list[Policy] = [Steady(0.0), Steady(1.0)]
    [log] = record_races(match, policies, [0], NAMES).logs
    results = run_match(match, policies).sort("car")
    (told,) = (incident for incident in log.incidents if incident.kind == "ending" and incident.cars == (1,))
    assert (
        told.text == f"2 quick: finished after {results['race_time_s'][1]:.3f} s, 6.000 s of it for penalties"
    )
    last_driven = log.time_s[log.samples["driving"][:, 1]][-1]
    assert last_driven < told.time_s <= last_driven + 0.1


def test_the_outline_has_the_pit_lane_of_the_circuit() -> None:
    track = load_track("lindenring")
    lane, along_m = outline(track).lane, np.arange(len(track.table)) * track.spacing
    inside = (along_m >= track.pit_lane.entry_m) | (along_m < track.pit_lane.exit_m)
    assert track.pit_lane.exit_m < track.pit_lane.entry_m, "it passes the line"
    np.testing.assert_array_equal(lane, np.where(inside, -1, 0))


def test_the_outline_has_the_kerbs_of_the_circuit() -> None:
    track = load_track("lindenring")
    lines = outline(track)
    for kerb, edge, column in (
        (lines.kerb_left, lines.left, KERB_LEFT),
        (lines.kerb_right, lines.right, KERB_RIGHT),
    ):
        width = np.linalg.norm((kerb - edge)[:, :2], axis=1)
        # Both ends are rounded, each by half a step in x and in y.
        np.testing.assert_allclose(width, track.table[:, column], atol=2**0.5 * RESOLUTION["x_m"])
        assert width.max() > 0.5
        assert (kerb[width == 0.0] == edge[width == 0.0]).all()


def test_who_makes_up_the_numbers_is_recorded_as_of_no_team(tmp_path: Path) -> None:
    match = match_on(tmp_path, 2, {"time_s": "1.0", "start": CHASE})
    seats = (Seat(0, TESTED), Seat(1, BACKGROUND))
    [log] = record_races(replace(match, races=(Race(0, seats),)), POLICIES, [0], NAMES).logs
    write_recording(tmp_path / "race.mcap", log)
    assert read_recording(tmp_path / "race.mcap").teams == (0, -1)
