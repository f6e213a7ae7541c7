"""The built-in driver on the circuit: its lap, its paces, its lanes, its manners."""

from __future__ import annotations

import numpy as np
import pytest

from policies.driver import Driver
from policies.load import load_policy
from policies.policy import Policy
from sim.errors import InputError
from sim.scenario import load_scenario
from sim.track import load_track
from sim.world import World
from tests.driving import GT3, start_at

TRACK = load_track("lindenring")


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


@pytest.fixture(scope="module")
def flying_laps() -> dict[str, np.void]:
    """The end of a flying lap alone, by the name of the driver."""
    names = ["driver", "driver:pace=0.9", "driver:pace=0.8", "driver:lane=2.0"]
    world = World(TRACK, GT3, len(names), 1)
    for race in range(len(names)):
        world.reset(race, start_at([-150.0], 0.0, speed=39.0, finish=TRACK.length))
    run(world, [[load_policy(name, "lindenring", "gt3")] for name in names], 160.0)
    return dict(zip(names, world.state[:, 0].copy(), strict=True))


def test_flying_lap_is_that_of_its_profile_and_stays_on_course(flying_laps: dict[str, np.void]) -> None:
    end = flying_laps["driver"]
    assert end["laps"] == 1
    assert end["off_course_s"] == 0.0
    assert end["wall_s"] == 0.0
    # Following a profile at ten decisions a second costs, never gains, a few per cent.
    profile = Driver("lindenring", "gt3").lap_s
    assert 90.0 < profile < 100.0
    assert end["last_lap_s"] == pytest.approx(profile, rel=0.05)


def test_pace_scales_the_speed(flying_laps: dict[str, np.void]) -> None:
    full = flying_laps["driver"]["last_lap_s"]
    for pace in (0.9, 0.8):
        end = flying_laps[f"driver:pace={pace}"]
        assert end["off_course_s"] == 0.0
        # A slower lap is followed more closely: at full pace the driver loses 3 % to its profile.
        assert end["last_lap_s"] == pytest.approx(full / pace, rel=0.03)


def test_holds_its_lane_on_the_straight() -> None:
    lanes = [-3.0, 0.0, 2.0]
    world = World(TRACK, GT3, 3, 1)
    for race, lane in enumerate(lanes):
        world.reset(race, start_at([1150.0], lane, speed=50.0))
    drivers: list[list[Policy]] = [[Driver("lindenring", "gt3", 0.9, lane)] for lane in lanes]
    history = run(world, drivers, 8.0)
    laterals = np.stack([state["lateral"][:, 0] for state in history])
    assert history[-1]["progress"].min() > 1500.0
    np.testing.assert_allclose(laterals - lanes, 0.0, atol=0.5)


def test_passes_a_slower_car_in_the_middle_without_touching_it() -> None:
    world = World(TRACK, GT3, 1, 2)
    world.reset(0, start_at([1150.0, 1090.0], speed=[0.6 * 52.0, 52.0]))
    slow, fast = Driver("lindenring", "gt3", 0.6, lane_m=0.0), Driver("lindenring", "gt3")
    end = run(world, [[slow, fast]], 14.0)[-1][0]
    assert end["contacts"].tolist() == [0, 0]
    assert end["off_course_s"].tolist() == [0.0, 0.0]
    assert end["progress"][1] > end["progress"][0] + 50.0


def test_a_race_of_eight_drivers_is_finished_by_most() -> None:
    scenario = load_scenario("race")
    world = World(TRACK, GT3, 1, 8)
    world.reset(0, scenario.place(TRACK, np.random.default_rng(0)))
    driver = Driver("lindenring", "gt3")
    rows: list[list[Policy]] = [[driver] * 8]
    run(world, rows, scenario.time_s)
    finished = np.isfinite(world.state["finish_s"][0])
    assert finished.sum() >= 6
    assert (world.state["best_lap_s"][0][finished] < 1.15 * driver.lap_s).all()


def test_each_row_of_a_batch_is_driven_alone() -> None:
    world = World(TRACK, GT3, 1, 8)
    world.reset(0, load_scenario("1v7").place(TRACK, np.random.default_rng(3)))
    driver = Driver("lindenring", "gt3")
    seen = world.observe(driver.observation_spec, np.zeros(8, np.int64), np.arange(8))
    memory = np.linspace(-1.0, 1.0, 8, dtype=np.float32)[:, None]
    actions, after = driver.act(seen, memory)
    assert actions.shape == (8, 2)
    assert actions.dtype == after.dtype == np.float32
    assert (np.abs(actions) <= 1.0).all()
    for car in range(8):
        alone, memory_alone = driver.act(seen[car : car + 1], memory[car : car + 1])
        np.testing.assert_allclose(alone[0], actions[car], rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(memory_alone[0], after[car], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("driver:pace=fast", "setting pace is 'fast', expected a number"),
        ("driver:pace=3", "pace is 3.0, expected 0.2 to 1.1"),
        ("driver:courage=1", "unknown setting 'courage', expected pace or lane"),
        ("driver:pace=nan", "pace is nan, expected 0.2 to 1.1"),
    ],
)
def test_faulty_settings_are_named(name: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        load_policy(name, "lindenring", "gt3")
