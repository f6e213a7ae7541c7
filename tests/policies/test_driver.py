"""The built-in driver: its line, its speed profile, its laps, its lanes, its manners."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from nathlon.policies.driver import Driver, Follower
from nathlon.policies.driver.disk_cache import cached
from nathlon.policies.driver.envelope import SPEEDS, WEIGHTS, envelope
from nathlon.policies.driver.margins import room
from nathlon.policies.driver.practice import LEAST_GRIP, practise
from nathlon.policies.driver.racing_line import minimum_time
from nathlon.policies.driver.speed_profile import Profile, corner_limit, path_of, profile
from nathlon.policies.driver.turning import backs_out, turn_round
from nathlon.policies.load import load_policy
from nathlon.policies.planning import Scene, decide
from nathlon.policies.policy import Policy
from nathlon.sim.car import load_car, load_compounds
from nathlon.sim.conditions import Conditions, Start
from nathlon.sim.errors import InputError
from nathlon.sim.physics.chassis import GRAVITY
from nathlon.sim.physics.course import SurfaceGrip
from nathlon.sim.service import Service
from nathlon.sim.track import WALL_LEFT, Track, load_track
from nathlon.sim.track.generating import write_generated
from nathlon.sim.weather import Shower, Weather, wet_share
from nathlon.sim.world import World
from tests.support.driving import GT3, circle, road, start_at

TRACK = load_track("lindenring")
GRIP = 0.97
PAIRS = (
    ("porto-sereno", "coupe", 120.235),
    ("lindenring", "gt3", 103.287),
    ("grandes-landes", "prototype", 176.965),
)
"""With the fastest lap by optimal control, s, by `benchmarks.lap_limit`."""


def run(world: World, drivers: list[list[Policy]], seconds: float) -> list[np.ndarray]:
    """Let drivers[race][car] drive; returns the state, (races, cars), after every step."""
    seats = [
        (np.array([race]), np.array([car]), driver, driver.initial_memory(1))
        for race, row in enumerate(drivers)
        for car, driver in enumerate(row)
    ]
    memories = [memory for *_, memory in seats]
    history = []
    for _ in range(round(seconds * 10)):
        actions = np.zeros((*world.state.shape, 2))
        for k, (race, car, driver, _) in enumerate(seats):
            seen = world.observe(driver.observation_spec, race, car)
            actions[race, car], memories[k] = driver.act(seen, memories[k])
        world.step(actions)
        history.append(world.state.copy())
        if not world.state["driving"].any():
            break
    return history


def on_grid(track: Track, cars: int, laps: int) -> Start:
    """A standing start of some cars for some laps."""
    place = np.arange(cars, dtype=np.float64)
    still = np.zeros(cars)
    return Start(
        distance=track.grid.pole_m - track.grid.spacing_m * place,
        lateral=np.where(place % 2 == 0, 1.0, -1.0) * track.grid.lateral_m,
        heading=still,
        speed=still,
        finish=np.full(cars, laps * track.length),
    )


@pytest.mark.parametrize(("circuit", "car", "limit_s"), PAIRS)
def test_a_standing_and_a_flying_lap_stay_on_the_course(circuit: str, car: str, limit_s: float) -> None:
    track, driver = load_track(circuit), Driver(circuit, car)
    world = World(track, load_car(car), 1, 1)
    world.reset(0, on_grid(track, 1, laps=2))
    run(world, [[driver]], 2.3 * driver.lap_s)
    end = world.state[0, 0]
    assert end["laps"] == 2
    assert end["off_course_s"] == 0.0
    assert end["wall_s"] == 0.0
    # Decisions at ten a second cost the driver something of what the profile promises.
    assert 0.998 * driver.lap_s < end["last_lap_s"] < 1.015 * driver.lap_s
    assert end["last_lap_s"] < 1.04 * limit_s


def test_pace_scales_the_speed_and_a_lane_is_kept_to() -> None:
    names = ["driver:pace=0.9", "driver:pace=0.8", "driver:pace=0.9,lane=2.0"]
    drivers = [load_policy(name, "lindenring", "gt3") for name in names]
    world = World(TRACK, GT3, len(names), 1)
    for race in range(len(names)):
        world.reset(race, start_at([-150.0], 0.0, speed=30.0, finish=TRACK.length))
    history = run(world, [[driver] for driver in drivers], 190.0)
    end = history[-1][:, 0]
    assert (end["off_course_s"] == 0.0).all()
    profile_s = Driver("lindenring", "gt3").lap_s
    for race, pace in enumerate((0.9, 0.8)):
        assert end["last_lap_s"][race] == pytest.approx(profile_s / pace, rel=0.01)
    laterals = np.array([state["lateral"][2, 0] for state in history[100:]])
    np.testing.assert_allclose(laterals, 2.0, atol=0.5)


def test_who_expects_a_wet_road_keeps_a_wet_generated_circuit(tmp_path: Path) -> None:
    path = str(write_generated(tmp_path, 1, "national", 1500.0))
    track = load_track(path)
    world = World(track, GT3, 1, 1, Conditions(grip=SurfaceGrip(tarmac=0.6, kerb=0.6)))
    world.reset(0, start_at([-20.0], finish=track.length))
    driver = load_policy("driver:grip=0.6", path, "gt3")
    end = run(world, [[driver]], 150.0)[-1][0, 0]
    assert end["laps"] == 1
    assert end["off_course_s"] == 0.0
    lap_s = Driver(path, "gt3", grip=0.6).lap_s
    assert end["last_lap_s"] == pytest.approx(lap_s, rel=0.1)  # it stood at the start
    # Speed in bends goes with the root of the grip, and more is lost on straights.
    assert lap_s > 1.05 * Driver(path, "gt3").lap_s


def test_passes_a_slower_car_in_the_middle_without_touching_it() -> None:
    world = World(TRACK, GT3, 1, 2)
    world.reset(0, start_at([1550.0, 1490.0], speed=[0.6 * 60.0, 60.0]))
    slow, fast = Driver("lindenring", "gt3", 0.6, lane_m=0.0), Driver("lindenring", "gt3")
    end = run(world, [[slow, fast]], 14.0)[-1][0]
    assert end["contacts"].tolist() == [0, 0]
    assert end["off_course_s"].tolist() == [0.0, 0.0]
    assert end["progress"][1] > end["progress"][0] + 50.0


def test_a_race_of_eight_drivers_is_finished_by_most() -> None:
    world = World(TRACK, GT3, 1, 8)
    world.reset(0, on_grid(TRACK, 8, laps=1))
    rows: list[list[Policy]] = [[Driver("lindenring", "gt3", pace) for pace in np.linspace(0.92, 1.0, 8)]]
    run(world, rows, 170.0)
    assert np.isfinite(world.state["finish_s"][0]).sum() >= 6


@pytest.mark.parametrize(
    ("turned", "left", "right", "expected"),
    [
        pytest.param(1.0, 20.0, 20.0, -1.0, id="the short way"),
        pytest.param(-1.0, 20.0, 20.0, 1.0, id="the short way, mirrored"),
        pytest.param(2.2, 8.0, 20.0, 1.0, id="away from a wall, though it is the long way"),
        pytest.param(3.0, 2.0, 20.0, 1.0, id="through the wider side"),
        pytest.param(3.0, 20.0, 2.0, -1.0, id="through the wider side, mirrored"),
        pytest.param(2.0, 4.0, 5.0, -1.0, id="the short way where there is no room"),
    ],
)
def test_turns_where_there_is_room(turned: float, left: float, right: float, expected: float) -> None:
    assert turn_round(turned, left, right, 8.0) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("heading", [1.5, -2.2, np.pi])
def test_drives_on_from_rest_whichever_way_it_faces(heading: float) -> None:
    track = load_track("lindenring")
    lateral = np.array([4.0, 0.0, -4.0])
    world = World(track, load_car("gt3"), 3, 1)
    for race in range(3):
        world.reset(
            race,
            Start(
                distance=np.array([300.0]),
                lateral=lateral[race : race + 1],
                heading=np.array([heading]),
                speed=np.zeros(1),
                finish=np.array([np.inf]),
            ),
        )
    run(world, [[Driver("lindenring", "gt3")]] * 3, 20.0)
    assert (world.state["progress"] > 400.0).all()


@pytest.mark.parametrize("heading", [-0.4, 0.0, 0.4])
def test_comes_back_from_as_far_out_as_the_gravel_goes(heading: float) -> None:
    track, driver = load_track("lindenring"), Driver("lindenring", "gt3")
    lateral = track.table[:, WALL_LEFT] - 4.0
    row = int(np.argmax(lateral - driver.line.offset))
    # A driver that gives up three per cent of its speed a metre would have none left.
    assert lateral[row] - driver.line.offset[row] > 33.4
    world = World(track, load_car("gt3"), 1, 1)
    world.reset(0, start_at([row * track.spacing], lateral=lateral[row], heading=heading))
    run(world, [[driver]], 24.0)
    assert world.state["progress"][0, 0] > row * track.spacing + 200.0
    assert not world.state["off_course"][0, 0]


@pytest.mark.parametrize(
    ("velocity", "turned", "left", "right", "expected"),
    [
        pytest.param(0.0, 1.5, 0.3, 9.0, True, id="nose at a wall"),
        pytest.param(0.0, -1.5, 0.3, 9.0, False, id="tail at a wall"),
        pytest.param(0.0, 1.5, 0.3, 0.3, False, id="no room behind either"),
        pytest.param(4.0, 1.5, 5.0, 5.0, False, id="room ahead"),
        pytest.param(-2.0, 1.5, 5.0, 5.0, True, id="backs on until there is plenty"),
        pytest.param(-2.0, 1.5, 9.0, 5.0, False, id="plenty"),
        pytest.param(-2.0, -1.5, 0.3, 5.0, False, id="as far back as can be"),
    ],
)
def test_backs_out_where_there_is_no_room_ahead(
    velocity: float, turned: float, left: float, right: float, expected: bool
) -> None:
    assert backs_out(velocity, turned, left, right) is expected


@pytest.mark.parametrize("heading", [1.5, 2.6])
def test_gets_away_with_its_nose_at_a_wall(heading: float) -> None:
    track = load_track("porto-sereno")
    driver = Driver("porto-sereno", "coupe")
    world = World(track, load_car("coupe"), 2, 1)
    row = round(700.0 / track.spacing)
    for race in range(2):
        world.reset(race, start_at([700.0], lateral=track.table[row, WALL_LEFT] - 2.5, heading=heading))
    world.state["has_reverse"][1] = True
    run(world, [[driver]] * 2, 25.0)
    assert world.state["progress"][1] > 750.0


def test_worn_tyres_and_a_slipstream_slow_the_driver_down() -> None:
    car, driver = load_car("prototype"), Driver("lindenring", "prototype")
    world = World(TRACK, car, 2, 1)
    for race in range(2):
        world.reset(race, start_at([-150.0], speed=40.0))
    world.state["wear"][1] = 1.0
    history = run(world, [[driver], [driver]], 60.0)
    new, worn = world.state[:, 0]
    assert worn["off_course_s"] == 0.0
    assert 0.9 * new["progress"] < worn["progress"] < 0.98 * new["progress"]

    first = np.zeros(1, np.int64)
    pedals = []
    for draught in (0.0, 1.0):
        row = []
        for state in history[::5]:
            world.state[0] = state[0]
            world.state["draught"][0] = draught
            seen = world.observe(driver.observation_spec, first, first)
            row.append(driver.act(seen, driver.initial_memory(1))[0][0, 0])
        pedals.append(np.array(row))
    assert (pedals[1] <= pedals[0]).all()
    assert (pedals[1] < pedals[0]).sum() > 10


def test_the_driver_feels_the_rain() -> None:
    """It stays on the road on which it goes off if it drives as in the dry; unfelt it drives as ever."""
    driver, none = Driver("lindenring", "gt3"), np.zeros(1, np.int64)
    rain = Weather(shower=(Shower(time_s=0.0, rain_mm_h=8.0),))
    world = World(TRACK, GT3, 2, 1, Conditions(weather=(rain,), film_mm=0.6))
    for race in range(2):
        world.reset(race, start_at([-150.0], speed=30.0))
        world.fit(race, 0, Service("wet"))
    memories = [driver.initial_memory(1)] * 2
    for _ in range(900):
        actions = np.zeros((2, 1, 2))
        for race in range(2):
            seen = world.observe(driver.observation_spec, none + race, none)
            if race == 0:
                acted = decide(driver, world, none, none, seen, memories[0])
            else:
                acted = driver.act(seen, memories[1])
            actions[race], memories[race] = acted
        world.step(actions)
    felt, unfelt = world.state[:, 0]
    assert felt["off_course_s"] == 0.0 < unfelt["off_course_s"]
    assert felt["progress"] > 2500.0
    whole = np.ones(1)
    for once, again in zip(
        driver.act(seen, memories[1]),
        driver.act_when_told(seen, memories[1], whole, whole, whole == 0.0, whole),
        strict=True,
    ):
        np.testing.assert_array_equal(once, again)


def test_the_driver_feels_the_tyres_that_a_race_begins_on_as_those_fitted_before_it() -> None:
    """It has practised on the car's own, each car of a mixed field on others."""
    weather, cars = (Weather(),), np.arange(2)
    models = GT3, load_car("coupe")
    begun = World(TRACK, models, 1, 2, Conditions(compound="wet", weather=weather, film_mm=0.6))
    fitted = World(TRACK, models, 1, 2, Conditions(weather=weather, film_mm=0.6))
    felt = []
    for world in (begun, fitted):
        world.state["model"][0] = cars
        world.reset(0, start_at([-150.0, -170.0], speed=30.0))
        for car in range(2):
            world.fit(0, car, Service("wet"))
        world.step(np.zeros((1, 2, 2)))
        felt.append(np.array(Scene(world, 0 * cars, cars).grips))
    np.testing.assert_allclose(felt[0], felt[1])
    known, film_mm = load_compounds(), float(begun.state["film"][0, 0])
    own = np.array([known[model.tyre.compound].grip for model in models])
    np.testing.assert_allclose(felt[0][0], known["wet"].grip / own * wet_share(film_mm, known["wet"].film_mm))


def test_the_driver_slows_down_on_its_line_for_a_blue_flag() -> None:
    driver, races = Driver("lindenring", "gt3"), np.arange(2)
    world = World(TRACK, GT3, 2, 1)
    for race in range(2):
        world.reset(race, start_at([-150.0], speed=30.0))
    world.state["flagged_for"][1] = 5
    memory = driver.initial_memory(2)
    for _ in range(300):
        seen = world.observe(driver.observation_spec, races, 0 * races)
        actions, memory = decide(driver, world, races, 0 * races, seen, memory)
        world.step(actions[:, None])
    free, flagged = world.state[:, 0]
    assert flagged["progress"] < free["progress"] - 100.0
    assert flagged["off_course_s"] == free["off_course_s"] == 0.0


def test_a_driver_that_is_told_a_pace_drives_as_one_with_that_pace() -> None:
    world, none = World(TRACK, GT3, 1, 1), np.zeros(1, np.int64)
    world.reset(0, start_at([100.0], speed=60.0))
    told, slower = (load_policy(name, "lindenring", "gt3") for name in ("driver", "driver:pace=0.9"))
    seen, memory = world.observe(told.observation_spec, none, none), told.initial_memory(1)
    world.ask_pace(0, 0, 0.9)
    actions, _ = decide(told, world, none, none, seen, memory)
    assert actions[0, 0] == slower.act(seen, memory)[0][0, 0] < told.act(seen, memory)[0][0, 0]


def test_each_row_of_a_batch_is_driven_alone() -> None:
    world = World(TRACK, GT3, 1, 8)
    world.reset(0, on_grid(TRACK, 8, laps=1))
    driver = Driver("lindenring", "gt3")
    seen = world.observe(driver.observation_spec, np.zeros(8, np.int64), np.arange(8))
    memory = np.linspace(-1.0, 1.0, 16, dtype=np.float32).reshape(8, 2)
    actions, after = driver.act(seen, memory)
    assert actions.shape == (8, 2)
    assert actions.dtype == after.dtype == np.float32
    assert (np.abs(actions) <= 1.0).all()
    for car in range(8):
        alone, memory_alone = driver.act(seen[car : car + 1], memory[car : car + 1])
        np.testing.assert_allclose(alone[0], actions[car], rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(memory_alone[0], after[car], rtol=1e-6, atol=1e-7)


def test_no_small_change_makes_the_line_much_faster() -> None:
    limits = envelope(GT3)
    left, right = room(TRACK)
    line = minimum_time(TRACK, limits, GRIP)
    assert (line < left + 0.05).all()
    assert (line > -right - 0.05).all()
    lap_s = profile(TRACK, line, limits, GRIP).lap_s
    rows = np.arange(len(line))
    for middle in range(0, len(line), len(line) // 25):
        bump = np.exp(-0.5 * ((rows - middle) / 20.0) ** 2)
        for side in (-0.4, 0.4):
            changed = np.clip(line + side * bump, -right, left)
            assert profile(TRACK, changed, limits, GRIP).lap_s > lap_s - 0.02


def test_the_fastest_line_around_a_circle_is_the_shortest() -> None:
    # Time goes with the root of the radius.
    track = circle(120.0)
    left, _ = room(track)
    line = minimum_time(track, envelope(GT3), GRIP)
    np.testing.assert_allclose(line, left, atol=0.25)


def test_practice_takes_grip_only_from_places_that_go_wrong() -> None:
    limits = envelope(GT3)
    offset = minimum_time(TRACK, limits, 1.0)

    def at(pace: float) -> NDArray[np.float64]:
        def follower(_: World, line: Profile) -> Policy:
            return Follower(TRACK, GT3, pace, line)

        return practise(TRACK, GT3, offset, limits, follower)

    assert (at(0.9) == 1.0).all()
    hurried = at(1.0)
    assert (hurried == 1.0).mean() > 0.2
    assert LEAST_GRIP <= hurried.min() < 0.99


def test_the_cache_holds_for_the_same_key_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    found: list[NDArray[np.float64]] = []

    def compute() -> NDArray[np.float64]:
        found.append(np.random.default_rng(len(found)).random((2, 5)))
        return found[-1]

    first = cached(compute, b"circuit", b"car")
    np.testing.assert_array_equal(cached(compute, b"circuit", b"car"), first)
    assert len(found) == 1
    assert (cached(compute, b"circuitc", b"ar") != first).all()
    assert len(found) == 2
    for file in tmp_path.rglob("*.npy"):
        file.write_bytes(b"torn")
    cached(compute, b"circuit", b"car")
    assert len(found) == 3
    np.testing.assert_array_equal(cached(compute, b"circuit", b"car"), found[2])


@pytest.mark.parametrize("bank", [0.0, -0.15, 0.1])
def test_corner_speed_on_a_banked_circle_has_its_closed_form(bank: float) -> None:
    limits = envelope(GT3)
    track = circle(120.0, bank=bank)
    speed = profile(track, np.zeros(len(track.table)), limits, GRIP).speed.max()
    # Forces in the plane of a road of angle `bank`, sideways and into it; a bend keeps its level.
    centripetal = speed**2 / 120.0
    along = centripetal * np.cos(bank) + GRAVITY * np.sin(bank)
    into = GRAVITY * np.cos(bank) - centripetal * np.sin(bank)
    assert along == pytest.approx(GRIP * corner_limit(speed, into, limits), rel=0.01)


def test_crests_are_taken_more_slowly_and_dips_faster() -> None:
    limits = envelope(load_car("coupe"))
    angle = np.linspace(0.0, 2 * np.pi, 720, endpoint=False)
    radius, height = 150.0, 4.0
    track = road(radius * np.cos(angle), radius * np.sin(angle), 6.0, 12.0, z=height * np.cos(4 * angle))
    flat = road(radius * np.cos(angle), radius * np.sin(angle), 6.0, 12.0)
    line = np.zeros(len(track.table))
    path, _ = path_of(track, line)
    heave = -16 * height / radius**2
    assert path.heave.min() == pytest.approx(heave, rel=0.02)
    hilly, level = profile(track, line, limits, GRIP).speed, profile(flat, line, limits, GRIP).speed
    top = int(np.argmin(path.heave))
    assert hilly[top] < level[top]
    used = hilly[top] ** 2 / radius / corner_limit(hilly[top], GRAVITY + heave * hilly[top] ** 2, limits)
    assert used == pytest.approx(GRIP, rel=0.02)


def test_braking_and_driving_stay_within_the_friction_ellipse() -> None:
    limits = envelope(GT3)
    # Grip that turns the car neither brakes nor drives it, load transfer aside.
    assert (np.diff(limits.brake, axis=2) <= 0.1).all()
    assert (np.diff(limits.traction, axis=2) <= 0.1).all()
    assert (np.diff(limits.corner, axis=1) >= 0.0).all()
    level = int(np.searchsorted(WEIGHTS, GRAVITY))
    slow = int(np.searchsorted(SPEEDS, 20.0))
    # Two driven wheels of a car of friction 1.6 pull less than four braked ones.
    assert limits.traction[slow, level, 0] < 0.8 * limits.brake[slow, level, 0]
    assert limits.brake[slow, level, 0] < 1.64 * WEIGHTS[level] * 1.05


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("driver:pace=fast", "setting pace is 'fast', expected a number"),
        ("driver:pace=3", "pace is 3.0, expected 0.2 to 1.1"),
        ("driver:courage=1", "unknown setting 'courage', expected one of pace, lane, early"),
        ("driver:grip=0", "grip is 0.0, expected 0.05 to 1.5"),
        ("driver:pace=nan", "setting pace is 'nan', expected a finite number"),
        ("driver:rollout=1", "rollout is 1.0, expected 2 to 20 s, or 0"),
        ("driver:rollout=5,lane=2", "has a rollout, expected neither lane nor early beside it"),
    ],
)
def test_faulty_settings_are_named(name: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        load_policy(name, "lindenring", "gt3")
