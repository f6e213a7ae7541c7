"""Stops: the way through the pit lane, what is done there, and who meets whom."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from nathlon.sim.car import load_car
from nathlon.sim.clock import DYNAMICS_DT
from nathlon.sim.conditions import Conditions, Start
from nathlon.sim.data_file import DATA
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.physics.pit_lane import (
    BRAKING,
    ENTERING,
    IN_BOX,
    LEAVING,
    ON_ROAD,
    PULLING,
    REJOINING,
    TOO_FAST,
)
from nathlon.sim.rules import load_rules
from nathlon.sim.service import Service
from nathlon.sim.track import load_track, read_track
from nathlon.sim.track.pit_lane import PitLane, laid_out
from nathlon.sim.world import World
from tests.support.refusals import refusal

TRACK, CAR = load_track("lindenring"), load_car("gt3")
LANE = TRACK.pit_lane
LIMIT = LANE.speed_m_s
PIT = load_rules("sporting").pit


def at_entry(cars: int = 1, before_m: float = 20.0, speed: float = LIMIT, apart_m: float = 15.0) -> World:
    """Cars before the entry line, one after the other, on worn tyres with half a tank."""
    world = World(TRACK, CAR, 1, cars, Conditions(wear_rate=1.0, fuel_rate=1.0), load_rules("sporting"))
    places = LANE.entry_m - before_m - apart_m * np.arange(cars, dtype=np.float64)
    still = np.zeros(cars)
    world.reset(0, Start(places, still, still, np.full(cars, speed), np.full(cars, np.inf)))
    world.state["wear"] = 0.5
    world.state["fuel"] = 40.0
    return world


def drive(world: World, until: float = 120.0) -> list[int]:
    """Roll on through the lane; the stages that the first car goes through."""
    stages = [ON_ROAD]
    for _ in range(int(until / DYNAMICS_DT)):
        world.step(np.zeros((1, world.state.shape[1], 2)), 1)
        stage = int(world.state["stage"][0, 0])
        if stage != stages[-1]:
            stages.append(stage)
            if stage == ON_ROAD:
                break
    return stages


def test_a_stop_goes_through_the_lane_and_back_to_the_road() -> None:
    world = at_entry()
    world.ask_stop(0, 0, Service("racing-soft", 60.0))
    assert drive(world) == [ON_ROAD, ENTERING, IN_BOX, LEAVING, REJOINING, ON_ROAD]
    car = world.state[0, 0]
    assert (car["stops"], car["missed"], car["asked"]) == (1, 0, False)


def test_a_stop_takes_what_way_and_service_take() -> None:
    """At the limit all the way, but for slowing down and getting away, which cost v / 2a each."""
    world = at_entry()
    world.ask_stop(0, 0, Service("racing-soft", 60.0))
    drive(world)
    way = LANE.length(TRACK.length) / LIMIT + LIMIT / (2 * BRAKING) + LIMIT / (2 * PULLING)
    service = PIT.tyres_s + 20.0 / PIT.fuel_kg_s
    assert world.state["lane_s"][0, 0] == pytest.approx(way + service, abs=0.3)


def test_tyres_and_fuel_are_what_was_asked_for() -> None:
    world = at_entry()
    world.ask_stop(0, 0, Service("racing-soft", 60.0))
    drive(world, until=50.0)
    car = world.state[0, 0]
    assert car["wear"].max() < 0.05
    assert 59.0 < car["fuel"] <= 60.0
    assert car["mass"] == pytest.approx(world.parameters.car.dry_mass + car["fuel"])
    assert (car["tyre_grip"], car["tyre_wear"]) == (1.04, 1.6)


def test_tyres_that_nobody_asked_for_stay_on_the_car() -> None:
    world = at_entry()
    world.ask_stop(0, 0, Service(fuel_kg=50.0))
    drive(world)
    assert world.state["wear"][0, 0].min() >= 0.5
    assert world.state["tyre_grip"][0, 0] == 1.0


def test_no_fuel_is_taken_out_and_no_more_put_in_than_the_tank_holds() -> None:
    for wanted, left in ((10.0, 40.0), (1e4, CAR.fuel.capacity_kg)):
        world = at_entry()
        world.ask_stop(0, 0, Service(fuel_kg=wanted))
        drive(world)
        assert world.state["fuel"][0, 0] == pytest.approx(left, abs=0.5)


def test_penalties_are_served_in_the_box_before_the_service() -> None:
    plain, punished = at_entry(), at_entry()
    punished.state["penalty_s"] = 5.0
    for world in (plain, punished):
        world.ask_stop(0, 0, Service("racing-hard"))
        drive(world)
    longer = punished.state["lane_s"] - plain.state["lane_s"]
    assert longer[0, 0] == pytest.approx(5.0, abs=2 * DYNAMICS_DT)
    assert punished.state["penalty_s"][0, 0] == 0.0


def test_a_car_slows_down_for_the_entry_by_itself() -> None:
    world = at_entry(before_m=40.0, speed=35.0)
    world.ask_stop(0, 0, Service())
    throttle = np.zeros((1, 1, 2))
    throttle[..., 0] = 1.0
    while world.state["stage"][0, 0] == ON_ROAD and world.time[0] < 30.0:
        world.step(throttle, 1)
    assert world.state["stage"][0, 0] == ENTERING
    assert world.state["missed"][0, 0] == 0


def test_who_is_too_fast_at_the_entry_misses_it_and_may_try_again() -> None:
    world = at_entry(before_m=2.0, speed=LIMIT + TOO_FAST + 5.0)
    world.ask_stop(0, 0, Service())
    world.step(np.zeros((1, 1, 2)), 30)
    car = world.state[0, 0]
    assert (car["stage"], car["missed"], car["asked"]) == (ON_ROAD, 1, True)


def test_who_does_not_ask_drives_past() -> None:
    world = at_entry()
    world.step(np.zeros((1, 1, 2)), 60)
    world.step(np.zeros((1, 1, 2)), 60)
    assert world.state["progress"][0, 0] > LANE.entry_m
    assert world.state["stage"][0, 0] == ON_ROAD


def test_nobody_meets_or_sees_a_car_in_the_lane() -> None:
    """One stands in its box; the other comes by on the very place, and through it."""
    world = at_entry(cars=2, apart_m=60.0)
    world.ask_stop(0, 0, Service("racing-hard"))
    while world.state["stage"][0, 0] != IN_BOX:
        world.step(np.zeros((1, 2, 2)), 1)
    here = world.state[0, 0]
    for name in ("x", "y", "yaw", "row", "along", "wraps", "progress", "lateral", "cos_yaw", "sin_yaw"):
        world.state[name][0, 1] = here[name]
    world.step(np.zeros((1, 2, 2)), 1)
    assert world.contact_count[0] == 0
    spec = ObservationSpec(cars_ahead=1, cars_behind=1)
    seen = world.observe(spec, np.array([0]), np.array([1]))[0]
    alone = at_entry()
    assert seen[spec.slice("cars_ahead")].tolist() == pytest.approx(
        alone.observe(spec, np.array([0]), np.array([0]))[0][spec.slice("cars_ahead")].tolist()
    )


def test_a_car_that_comes_back_meets_others_only_once_there_is_room() -> None:
    world = at_entry(cars=2)
    world.state["stage"][0, 0] = REJOINING
    world.state["clear_s"][0, 0] = 10.0
    for _ in range(60):  # side by side
        for name in ("x", "y", "progress", "row", "along", "wraps"):
            world.state[name][0, 1] = world.state[name][0, 0]
        world.step(np.zeros((1, 2, 2)), 1)
        assert world.state["stage"][0, 0] == REJOINING
    world.state["driving"][0, 1] = False
    world.step(np.zeros((1, 2, 2)), 1)
    assert world.state["stage"][0, 0] == ON_ROAD


def test_laps_are_timed_in_the_lane_as_on_the_road() -> None:
    world = at_entry()
    world.ask_stop(0, 0, Service())
    drive(world)
    car = world.state[0, 0]
    assert LANE.exit_m < LANE.entry_m  # the line lies between
    assert car["laps"] == 1
    assert math.isfinite(car["line_s"][0])


@pytest.mark.parametrize("name", ["lindenring", "porto-sereno", "grandes-landes"])
def test_every_circuit_has_a_lane_that_is_straight_and_passes_the_line(name: str) -> None:
    track = load_track(name)
    lane = track.pit_lane
    assert lane.exit_m < lane.entry_m < track.length
    inside = np.arange(int(lane.entry_m / track.spacing), int(lane.entry_m / track.spacing) + 200)
    assert np.abs(track.table[inside % len(track.table), 4]).mean() < 1 / 500


def test_a_lane_is_laid_out_along_the_straightest_stretch_before_the_line() -> None:
    curvature = np.full(1000, 0.01)
    curvature[820:920] = 0.0
    curvature[300:600] = 0.0  # too far from the line
    room = np.full(1000, 5.0)
    lane = laid_out(curvature, room, room + 1.0, 2.0)
    assert lane.side == "right"
    assert 1600 <= lane.entry_m + lane.length(2000.0) / 2 <= 1900
    assert lane.length(2000.0) == pytest.approx(400.0)


def circuit(tmp_path: Path, lane: str) -> Path:
    source = DATA / "circuits" / "lindenring"
    (tmp_path / "centre_line.csv").write_bytes((source / "centre_line.csv").read_bytes())
    path = tmp_path / "circuit.toml"
    path.write_text((source / "circuit.toml").read_text("utf-8") + f"\n[pit_lane]\n{lane}\n", "utf-8")
    return path


def test_a_file_says_where_the_lane_lies(tmp_path: Path) -> None:
    lane = 'side = "left"\nentry_m = 5500\nexit_m = 100\nspeed_m_s = 16.7'
    assert read_track(circuit(tmp_path, lane)).pit_lane == PitLane(
        side="left", entry_m=5500.0, exit_m=100.0, speed_m_s=16.7
    )


@pytest.mark.parametrize(
    ("lane", "complaint"),
    [
        ('side = "up"\nentry_m = 5500\nexit_m = 100', "field pit_lane.side is 'up': .*'left' or 'right'"),
        ('side = "left"\nentry_m = 9000\nexit_m = 100', "pit_lane is not on the lap"),
        ('side = "left"\nentry_m = 100\nexit_m = 110', "pit_lane is 10.0 m long, expected at least 50 m"),
        ('side = "left"\nentry_m = 100\nexit_m = 5000', "pit_lane is 4900.0 m long"),
    ],
)
def test_a_lane_that_cannot_be_is_refused(tmp_path: Path, lane: str, complaint: str) -> None:
    path = circuit(tmp_path, lane)
    with refusal(path, complaint):
        read_track(path)


def test_an_unknown_compound_is_refused() -> None:
    with pytest.raises(InputError, match="tyre compound 'butter' is unknown"):
        at_entry().ask_stop(0, 0, Service("butter"))
