"""Scenarios: where cars are put, and what is said about faulty files."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.car import load_car
from nathlon.sim.conditions import Start
from nathlon.sim.data_file import DATA
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.physics.course import SurfaceGrip
from nathlon.sim.scenario import SAFE_LATERAL, Scenario, load_scenario
from nathlon.sim.track import CURVATURE, LEFT, RIGHT, WALL_LEFT, WALL_RIGHT, Track, load_track
from tests.support.refusals import refusal

TRACKS = {name: load_track(name) for name in ("grandes-landes", "lindenring", "porto-sereno")}
TRACK = TRACKS["lindenring"]
NAMES = sorted(path.stem for path in (DATA / "scenarios").glob("*.toml"))
CARS = [load_car(name) for name in ("gt3", "coupe", "prototype")]
LENGTH, WIDTH = max(car.body.length_m for car in CARS), max(car.body.width_m for car in CARS)
seeds = st.integers(0, 2**63 - 1)


def corners(start: Start) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance and lateral of the four corners of the longest, widest car at each place, (cars, 4)."""
    along, across = LENGTH / 2 * np.array([1, 1, -1, -1]), WIDTH / 2 * np.array([1, -1, -1, 1])
    sine, cosine = np.sin(start.heading)[:, None], np.cos(start.heading)[:, None]
    return (
        start.distance[:, None] + along * cosine - across * sine,
        start.lateral[:, None] + along * sine + across * cosine,
    )


def room_to_walls(track: Track, start: Start) -> float:
    """How far (m) the corner nearest to a wall stands from it; negative is inside."""
    distance, lateral = corners(start)
    row = (np.mod(distance, track.length) / track.spacing).astype(np.int64) % len(track.table)
    # Corners are placed along the arc of the road.
    bent = lateral - 0.5 * track.table[row, CURVATURE] * (distance - start.distance[:, None]) ** 2
    left, right = track.table[row, WALL_LEFT] - bent, track.table[row, WALL_RIGHT] + bent
    return float(np.minimum(left, right).min())


def room_between(start: Start) -> float:
    """How far (m) the two cars nearest to each other stand apart along the road or across it."""
    boxes = [(*d, *n) for d, n in zip(*corners(start), strict=True)]
    apart = np.inf
    for one, other in combinations(np.array(boxes).reshape(-1, 2, 4), 2):
        gaps = [max(a.min() - b.max(), b.min() - a.max()) for a, b in zip(one, other, strict=True)]
        apart = min(apart, max(gaps))
    return float(apart)


@pytest.mark.parametrize("circuit", TRACKS)
@pytest.mark.parametrize("name", NAMES)
def test_shipped_scenario_puts_all_its_cars_on_free_places(name: str, circuit: str) -> None:
    scenario, track = load_scenario(name), TRACKS[circuit]
    assert scenario.name == name
    if scenario.origin == "last chicane" and circuit == "porto-sereno":
        with pytest.raises(InputError, match="circuit 'porto-sereno' has no section 'last chicane'"):
            scenario.place(track, np.random.default_rng(0))
        return
    for seed in range(20):
        start = scenario.place(track, np.random.default_rng(seed))
        again = scenario.place(track, np.random.default_rng(seed))
        for array, same in zip(vars(start).values(), vars(again).values(), strict=True):
            assert np.shape(array) in ((scenario.cars,), ()), "() is one number for all"
            assert np.isfinite(array).all() or array is start.finish
            np.testing.assert_array_equal(array, same)
        assert (np.diff(start.distance) < 0.0).all()
        assert room_between(start) > 0.5 or scenario.cars == 1
        assert room_to_walls(track, start) > 0.0
        assert (start.finish > start.distance.max()).all()


@pytest.mark.parametrize("circuit", TRACKS)
@pytest.mark.parametrize("name", ["1v0", "1v2", "1v3", "1v7"])
def test_start_anywhere_is_never_inside_a_wall_or_another_car(name: str, circuit: str) -> None:
    scenario, rng = load_scenario(name), np.random.default_rng(1)
    for _ in range(500):
        start = scenario.place(TRACKS[circuit], rng)
        assert room_to_walls(TRACKS[circuit], start) > 0.0
        assert scenario.cars == 1 or room_between(start) > 0.0


@given(seeds)
def test_grid_is_staggered_behind_the_line(seed: int) -> None:
    scenario = load_scenario("race")
    start = scenario.place(TRACK, np.random.default_rng(seed))
    grid = TRACK.grid
    np.testing.assert_allclose(start.distance, grid.pole_m - grid.spacing_m * np.arange(8), atol=0.3)
    np.testing.assert_allclose(start.lateral, grid.lateral_m * (-1.0) ** np.arange(8), atol=0.3)
    assert (start.distance < 0).all()
    assert (start.speed == 0).all()
    assert (start.finish == 2 * TRACK.length).all()


def test_formation_moves_towards_the_line_two_by_two() -> None:
    scenario = load_scenario("grand_prix")
    start = scenario.place(TRACK, np.random.default_rng(0))
    np.testing.assert_allclose(start.distance, -60.0 - 9.0 * np.arange(20))
    np.testing.assert_allclose(start.lateral, TRACK.grid.lateral_m * (-1.0) ** np.arange(20))
    assert (start.speed == 25.0).all()
    assert (start.heading == 0.0).all()
    assert (start.finish == 3 * TRACK.length).all()


def test_a_formation_is_as_orderly_as_it_says() -> None:
    scenario = load_scenario("grand_prix_stops")
    one, other, again = (scenario.place(TRACK, np.random.default_rng(seed)) for seed in (1, 2, 1))
    np.testing.assert_allclose(one.distance, -60.0 - 9.0 * np.arange(20), atol=0.3)
    np.testing.assert_allclose(one.lateral, TRACK.grid.lateral_m * (-1.0) ** np.arange(20), atol=0.3)
    assert (one.distance != other.distance).all()
    assert (one.lateral != other.lateral).all()
    assert (one.distance == again.distance).all()


@given(seeds, st.sampled_from(sorted(TRACKS)))
def test_cars_abreast_are_beside_each_other_before_the_end_of_their_origin(seed: int, circuit: str) -> None:
    track = TRACKS[circuit]
    _, end = track.stretch("longest straight")
    start = load_scenario("braking_duel").place(track, np.random.default_rng(seed))
    assert end - 320.0 <= start.distance[0] <= end - 280.0
    assert 0.2 <= start.distance[0] - start.distance[1] <= 2.0
    assert sorted(start.lateral) == [-2.0, 2.0]
    assert len(set(start.speed)) == 1
    assert 48.0 <= start.speed[0] <= 52.0
    assert (start.finish == end + 130.0).all()


def test_the_side_of_the_first_of_cars_abreast_is_drawn_by_lot() -> None:
    sides = [
        load_scenario("braking_duel").place(TRACK, np.random.default_rng(seed)).lateral[0]
        for seed in range(200)
    ]
    # Of 200 throws of a coin, the deviation is 7.
    assert 100 - 28 <= sum(side > 0 for side in sides) <= 100 + 28


@given(seeds, st.sampled_from(["lindenring", "grandes-landes"]))
def test_rolling_start_is_drawn_from_its_spans_at_its_origin(seed: int, circuit: str) -> None:
    track = TRACKS[circuit]
    begin, end = track.stretch("last chicane")
    start = load_scenario("chicane_in_traffic").place(track, np.random.default_rng(seed))
    assert begin - 260.0 <= start.distance[0] <= begin - 250.0
    gaps = -np.diff(start.distance)
    assert ((gaps >= 11.0) & (gaps <= 15.0)).all()
    assert (np.abs(start.lateral) <= 2.5).all()
    assert len(set(start.speed)) == 1
    assert 42.0 <= start.speed[0] <= 44.0
    assert (start.finish == end + 150.0).all()


@given(seeds, st.sampled_from(sorted(TRACKS)))
def test_an_attacker_comes_from_behind_and_faster(seed: int, circuit: str) -> None:
    track = TRACKS[circuit]
    begin, end = track.stretch("longest straight")
    start = load_scenario("defending").place(track, np.random.default_rng(seed))
    assert begin + 200.0 <= start.distance[0] <= begin + 350.0
    assert 14.0 <= start.distance[0] - start.distance[1] <= 22.0
    assert 42.0 <= start.speed[0] <= 45.0
    assert 3.0 <= start.speed[1] - start.speed[0] <= 6.0
    assert (start.finish == end + 130.0).all()


@given(seeds, st.sampled_from(sorted(TRACKS)))
def test_a_stopped_car_leaves_room_to_pass_on_the_road(seed: int, circuit: str) -> None:
    track = TRACKS[circuit]
    start = load_scenario("emergency_avoidance").place(track, np.random.default_rng(seed))
    assert start.speed[0] == 0.0
    assert len(set(start.speed[1:])) == 1
    assert (start.speed[1:] >= 38.0).all()
    assert (start.heading[1:] == 0.0).all()
    assert 90.0 <= start.distance[0] - start.distance[1] <= 150.0
    assert 12.0 <= start.distance[1] - start.distance[2] <= 25.0
    _, lateral = corners(start)
    row = int(start.distance[0] / track.spacing)
    beside = max(track.table[row, LEFT] - lateral[0].max(), lateral[0].min() + track.table[row, RIGHT])
    assert beside > WIDTH


def test_origin_may_be_any_section_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    section = TRACK.sections[3]
    rolling = 'kind = "rolling"\nleader_m = [5.0, 5.0]\ngap_m = [9.0, 9.0]\nlateral_m = [0.0, 0.0]\n'
    text = GOOD.replace("laps = 1", f"finish_m = 20.0\norigin = {section.name!r}")
    path.write_text(text.replace('kind = "grid"', rolling + "speed_m_s = [30.0, 30.0]"))
    start = load_scenario(str(path)).place(TRACK, np.random.default_rng(0))
    assert start.distance == pytest.approx([section.start_m + 5.0, section.start_m - 4.0])
    assert (start.finish == section.end_m + 20.0).all()


@given(seeds)
@settings(max_examples=50)
def test_start_anywhere_is_no_faster_than_the_next_bend_allows(seed: int) -> None:
    start = load_scenario("1v3").place(TRACK, np.random.default_rng(seed))
    assert (start.finish == np.inf).all()
    along = np.arange(len(TRACK.table)) * TRACK.spacing
    for distance, speed in zip(start.distance[1:], start.speed[1:], strict=True):
        ahead = np.mod(along - distance, TRACK.length) < 100.0
        assert speed**2 * np.abs(TRACK.table[ahead, CURVATURE]).max() <= SAFE_LATERAL * 1.001


@given(seeds, st.sampled_from(sorted(TRACKS)))
def test_a_spun_car_stands_clear_of_the_walls(seed: int, circuit: str) -> None:
    track = TRACKS[circuit]
    start = load_scenario("recovery").place(track, np.random.default_rng(seed))
    assert start.speed.tolist() == [0.0]
    assert -np.pi <= start.heading[0] <= np.pi
    _, lateral = corners(start)
    row = int(start.distance[0] / track.spacing)
    assert -track.table[row, WALL_RIGHT] < lateral[0].min()
    assert lateral[0].max() < track.table[row, WALL_LEFT]


def test_spun_cars_face_anywhere() -> None:
    scenario, rng = load_scenario("recovery"), np.random.default_rng(0)
    heading = np.array([scenario.place(TRACK, rng).heading[0] for _ in range(400)])
    counts, _ = np.histogram(heading, 10, (-np.pi, np.pi))
    assert counts.min() > 40 - 4 * 6
    assert counts.max() < 40 + 4 * 6


def test_spun_cars_stand_on_the_road_and_beside_it_out_to_the_walls() -> None:
    scenario, rng = load_scenario("recovery"), np.random.default_rng(0)
    starts = [scenario.place(TRACK, rng) for _ in range(400)]
    row = np.array([int(start.distance[0] / TRACK.spacing) for start in starts])
    lateral = np.array([start.lateral[0] for start in starts])
    left, right = lateral - TRACK.table[row, LEFT], -lateral - TRACK.table[row, RIGHT]
    for beside in (left > 0.0, right > 0.0, (left < 0.0) & (right < 0.0)):
        assert beside.mean() > 0.15
    room = TRACK.table[row, WALL_LEFT] - TRACK.table[row, LEFT]
    share = (left / room)[left > 0.0]
    assert 0.4 < share.mean() < 0.6
    assert share[room[left > 0.0] > 20.0].max() > 0.8


def test_start_anywhere_covers_the_lap() -> None:
    scenario, rng = load_scenario("1v0"), np.random.default_rng(0)
    distance = np.array([scenario.place(TRACK, rng).distance[0] for _ in range(400)])
    # Of 400 even draws, a tenth of the lap gets 40 with a deviation of 6.
    counts, _ = np.histogram(distance, 10, (0.0, TRACK.length))
    assert counts.sum() == 400
    assert counts.min() > 40 - 4 * 6
    assert counts.max() < 40 + 4 * 6


GOOD = """
name = "test"
description = ""
cars = 2
laps = 1
time_s = 60.0
[start]
kind = "grid"
"""


def written(folder: Path, extra: str) -> Scenario:
    """The good scenario with lines of its own before the table of the start."""
    path = folder / "scenario.toml"
    path.write_text(GOOD.replace("[start]", extra + "\n[start]"))
    return load_scenario(str(path))


class TestConditions:
    def test_without_any_the_world_is_the_plain_one(self, tmp_path: Path) -> None:
        scenario = written(tmp_path, "")
        assert scenario.reaction.period.tolist() == [6, 6]
        assert scenario.reaction.delay.tolist() == [0, 0]
        world = scenario.world(TRACK, CARS[0], 3, threads=2)
        assert world.state.shape == (3, 2)
        world.reset(0, scenario.place(TRACK, np.random.default_rng(0)))
        for _ in range(20):
            world.step(np.ones((3, 2, 2)))
        assert (world.state[0]["wear"] == 0.0).all()
        assert (world.state[0]["fuel"] == world.parameters.car.fuel_capacity).all()

    def test_wear_and_fuel_go_at_their_rates(self, tmp_path: Path) -> None:
        used = []
        for rate in (1.0, 4.0):
            scenario = written(tmp_path / "", f"wear_rate = {rate}\nfuel_rate = {rate}")
            load_scenario.cache_clear()
            world = scenario.world(TRACK, CARS[0], 1)
            world.reset(0, scenario.place(TRACK, np.random.default_rng(0)))
            for _ in range(20):
                world.step(np.broadcast_to([1.0, 0.1], (1, 2, 2)))
            cars = world.state[0]
            used.append((world.parameters.car.fuel_capacity - cars["fuel"], cars["wear"][:, 2:].mean(axis=1)))
        for slow, fast in zip(*used, strict=True):
            # Lighter and more worn, the second car drives a little differently.
            assert (slow > 0.0).all()
            np.testing.assert_allclose(fast, 4 * slow, rtol=0.02)

    def test_rules_and_compound_reach_the_world(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="rules 'wild' is unknown"):
            written(tmp_path, 'rules = "wild"').world(TRACK, CARS[0], 1)
        load_scenario.cache_clear()
        with pytest.raises(InputError, match=r"tyre compound .cheese. is unknown"):
            written(tmp_path, 'compound = "cheese"').world(TRACK, CARS[0], 1)

    @pytest.mark.parametrize(
        ("lines", "period", "delay"),
        [
            ("action_hz = 20.0", [3, 3], [0, 0]),
            ("action_hz = 60", [1, 1], [0, 0]),
            ("action_hz = [10.0, 5.0]", [6, 12], [0, 0]),
            ("perception_delay_s = 0.1", [6, 6], [6, 6]),
            ("perception_delay_s = [0.0, 0.24]", [6, 6], [0, 14]),
        ],
    )
    def test_reaction_is_one_for_all_or_one_for_each(
        self, tmp_path: Path, lines: str, period: list[int], delay: list[int]
    ) -> None:
        reaction = written(tmp_path, lines).reaction
        assert reaction.period.tolist() == period
        assert reaction.delay.tolist() == delay


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("cars = 2", "cars = 0", "field cars is 0: .*greater than or equal to 1"),
        ("cars = 2", "cars = 21", "field cars is 21: .*less than or equal to 20"),
        ("cars = 2", "cars = 2.5", "field cars is 2.5: .*integer"),
        ("cars = 2", "", "field cars: Field required"),
        (
            "cars = 2",
            "cars = 2\nboats = 1",
            "field boats is unknown; expected one of action_hz, blur, cars, .*",
        ),
        (
            'kind = "grid"',
            'kind = "grid"\ngap_m = 9.0',
            "field start.grid.gap_m is unknown; expected one of jitter_m, kind$",
        ),
        ("laps = 1", "laps = 1\nfinish_m = 100.0", "laps and finish_m exclude each other"),
        ("time_s = 60.0", "time_s = -1.0", "field time_s is -1.0"),
        ("time_s = 60.0", "time_s = inf", "field time_s is inf"),
        (
            "laps = 1",
            "action_hz = 7.0",
            "field action_hz.* is 7.0: .*expected 5, 6, 10, 12, 15, 20, 30 or 60",
        ),
        ("laps = 1", "action_hz = 120.0", "field action_hz.* is 120.0: .*expected 5, 6, 10"),
        ("laps = 1", "action_hz = [10.0]", "action_hz must be one number, or 2, one for each car"),
        ("laps = 1", "perception_delay_s = 0.5", "field perception_delay_s.* is 0.5: .*less than or equal"),
        ("laps = 1", "perception_delay_s = -0.1", "field perception_delay_s.* is -0.1: .*greater than or"),
        ("laps = 1", "perception_delay_s = [0.1, 0.1, 0.1]", "perception_delay_s must be one number, or 2"),
        ("laps = 1", "wear_rate = -1.0", "field wear_rate is -1.0"),
        ("laps = 1", "grip = { tarmac = 0.0 }", "field grip.tarmac is 0.0: .*greater than or equal to 0.05"),
        ("laps = 1", "grip = { snow = 0.3 }", "field grip.snow is unknown; expected one of grass, gravel"),
        (
            'kind = "grid"',
            'kind = "flying"',
            "field start.*'grid', 'rolling', 'formation', 'abreast', 'anywhere'",
        ),
        ('kind = "grid"', 'kind = "rolling"', "field start.rolling.leader_m: Field required"),
        (
            'kind = "grid"',
            'kind = "formation"\nleader_m = -9.0',
            "field start.formation.gap_m: Field required",
        ),
        (
            'kind = "grid"',
            'kind = "rolling"\nleader_m = [0.0, 0.0]\ngap_m = [9.0, 9.0]\nlateral_m = [0.0, 0.0]\n'
            "speed_m_s = [9.0, 9.0]\nclosing_m_s = [3.0, 1.0]",
            "field start.rolling.closing_m_s is .*: expected the smaller number first",
        ),
        ("[start]", "[start", "not a TOML file"),
    ],
)
def test_faulty_field_is_named(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(GOOD)
    assert load_scenario(str(path)).cars == 2
    load_scenario.cache_clear()
    path.write_text(GOOD.replace(old, new))
    with refusal(path, complaint):
        load_scenario(str(path))


def test_unknown_scenario_lists_the_known() -> None:
    with pytest.raises(InputError, match="scenario '1v99' is unknown; expected one of 1v0, 1v1"):
        load_scenario("1v99")
    with pytest.raises(InputError, match=r"nowhere\.toml: cannot read the scenario file"):
        load_scenario("nowhere.toml")


def test_laps_in_the_name_change_laps_and_time_and_nothing_else(tmp_path: Path) -> None:
    race, longer = load_scenario("race"), load_scenario("race:laps=6")
    assert (longer.laps, longer.time_s) == (6, 3 * race.time_s)
    assert longer.model_copy(update={"laps": race.laps, "time_s": race.time_s}) == race
    path = tmp_path / "mine.toml"
    path.write_bytes((DATA / "scenarios" / "sprint.toml").read_bytes())
    assert load_scenario(f"{path}:laps=3").laps == 3


def test_compound_and_delay_in_the_name_are_those_of_all_cars() -> None:
    race, changed = load_scenario("race"), load_scenario("race:laps=3,compound=racing-soft,delay=0.1")
    assert changed.laps == 3
    assert changed.reaction.delay.tolist() == 8 * [6]
    assert race.reaction.delay.tolist() == 8 * [0]
    soft, own = (scenario.world(TRACK, CARS[0], 1).parameters for scenario in (changed, race))
    assert str(soft) != str(own)
    same = race.model_copy(update={"compound": "racing-soft"}).world(TRACK, CARS[0], 1).parameters
    assert str(soft) == str(same)


def test_a_person_in_the_name_acts_in_every_step_and_the_others_as_before() -> None:
    race, driven = load_scenario("race"), load_scenario("race:cars=3,person=2")
    assert driven.cars == 3
    assert driven.reaction.period.tolist() == [6, 1, 6]
    assert driven.reaction.tick == 1
    assert driven.time_s == race.time_s
    assert load_scenario("race:person=8").reaction.period.tolist() == [*7 * [6], 1]


def test_grip_in_the_name_is_that_of_all_surfaces() -> None:
    dry, wet = (load_scenario(name).world(TRACK, CARS[0], 1).parameters for name in ("race", "race:grip=0.6"))
    for friction in ("friction_x", "friction_y", "friction_x_slope", "friction_y_slope"):
        assert getattr(wet.car, friction) == pytest.approx(0.6 * getattr(dry.car, friction))
    np.testing.assert_array_equal(wet.course.surface_grip, dry.course.surface_grip)
    named = load_scenario("race").model_copy(update={"grip": SurfaceGrip(tarmac=0.5, grass=0.8)})
    course = named.world(TRACK, CARS[0], 1).parameters.course
    np.testing.assert_allclose(course.surface_grip, [1.0, 0.92 / 0.5, 0.55 * 0.8 / 0.5, 0.48 / 0.5])


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("race:laps=0", "laps is '0', expected a number from 1 to 1000"),
        ("race:laps=", "laps is '', expected"),
        ("race:laps=2.5", "laps is '2.5', expected"),
        ("standing_start:laps=2", "standing_start is not driven in laps"),
        ("chess:laps=2", "scenario 'chess' is unknown"),
        ("race:compound=chewing-gum", "compound 'chewing-gum' is unknown, expected one of comfort-hard"),
        ("race:delay=0.4", "delay is '0.4', expected seconds from 0 to 0.3"),
        ("race:delay=nan", "delay is 'nan', expected seconds"),
        ("race:laps=3,weather=wet", "unknown setting 'weather', expected one of laps, cars, person, comp"),
        ("race:cars=21", "cars is '21', expected a number from 1 to 20"),
        ("race:person=9", "person is '9', expected a number from 1 to 8"),
        ("race:cars=4,person=5", "person is '5', expected a number from 1 to 4"),
        ("race:person=2,cars=4", "says of each car what it does, expected no setting cars"),
        ("race:grip=0", "grip is '0', expected a multiple from 0.05 to 1.5"),
        ("race:grip=wet", "grip is 'wet', expected a multiple"),
        ("grand_prix_rain:rain=2", "rain is '2', expected a share from 0 to 1"),
    ],
)
def test_settings_that_cannot_be_are_one_sentence(name: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        load_scenario(name)


def test_a_share_of_the_rain_falls_and_lies() -> None:
    """The weathers are still those that may come, with their chances."""
    whole, half = (load_scenario(f"grand_prix_rain{share}") for share in ("", ":rain=0.5"))
    assert [one.chance for one in half.weather] == [one.chance for one in whole.weather]
    assert [one.rain_mm_h(300.0, 1) for one in whole.weather] == [6.0, 14.0, 0.0]
    assert [one.rain_mm_h(300.0, 1) for one in half.weather] == [3.0, 7.0, 0.0]
    assert load_scenario("drying_road:rain=0.5").film_mm == 0.2


def test_a_dirty_lens_is_before_cameras_alone_and_adds_to_their_own_faults() -> None:
    haze = load_scenario("race:blur=3,noise=12,hz=20").reaction.haze
    numbers, own = ObservationSpec(), ObservationSpec(camera=CameraSpec(blur=2, noise=5.0))
    assert haze.before(numbers) is numbers
    seen = haze.before(own).camera
    assert seen is not None
    assert (seen.blur, seen.noise) == (4, 13.0)
    assert load_scenario("race").reaction.haze.before(own) is own
    assert load_scenario("race:hz=20").reaction.period.tolist() == [3] * load_scenario("race").cars
    with pytest.raises(InputError, match="noise is '99', expected a deviation from 0 to 64"):
        load_scenario("race:noise=99")
