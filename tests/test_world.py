"""The world: same seed, same bits, whatever the batch; off course; laps; cars that are done."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.observation import ObservationSpec
from sim.physics.course import course_parameters, stand_on, time_laps
from sim.scenario import load_scenario
from sim.state import CAR_STATE
from sim.track import Track, load_track
from sim.world import AGENT_DT, DYNAMICS_DT, World
from tests.driving import GT3, circle, drive, stadium, start_at, world_with

LINDENRING = load_track("lindenring")


def race(world: World, index: int, seed: int) -> None:
    world.reset(index, load_scenario("1v3").place(LINDENRING, np.random.default_rng(seed)))


def script(seed: int, steps: int) -> np.ndarray:
    """Actions of four cars that hit each other and the walls, (steps, 4, 2)."""
    return np.random.default_rng(seed).uniform((-0.3, -0.5), (1.0, 0.5), (steps, 4, 2))


class TestDeterminism:
    def test_same_start_and_actions_give_the_same_bits(self) -> None:
        ends = []
        for _ in range(2):
            world = World(LINDENRING, GT3, 1, 4)
            race(world, 0, 7)
            for actions in script(7, 100):
                world.step(actions[None])
            ends.append((world.state.tobytes(), world.impact.tobytes(), world.time.tobytes()))
        assert ends[0] == ends[1]

    def test_a_race_does_not_depend_on_its_batch_or_its_slot(self) -> None:
        scripts = [script(seed, 100) for seed in range(5)]
        batch = World(LINDENRING, GT3, 5, 4)
        for seed in range(5):
            race(batch, seed, seed)
        for step in range(100):
            batch.step(np.stack([actions[step] for actions in scripts]))
        assert (batch.state["contacts"] > 0).any(), "the test needs a race with contacts"
        spec = ObservationSpec(course_points=16)
        cars = np.arange(4)
        for seed in (4, 0, 2):
            alone = World(LINDENRING, GT3, 1, 4)
            race(alone, 0, seed)
            for actions in scripts[seed]:
                alone.step(actions[None])
            assert alone.state[0].tobytes() == batch.state[seed].tobytes()
            assert alone.impact[0].tobytes() == batch.impact[seed].tobytes()
            seen = batch.observe(spec, np.full(4, seed), cars)
            assert alone.observe(spec, np.zeros(4, np.int64), cars).tobytes() == seen.tobytes()

    def test_reset_leaves_nothing_of_the_run_before(self) -> None:
        used, fresh = World(LINDENRING, GT3, 2, 4), World(LINDENRING, GT3, 2, 4)
        race(used, 0, 1)
        race(used, 1, 1)
        for actions in script(1, 80):
            used.step(np.stack([actions, actions]))
        race(used, 0, 2)
        race(fresh, 0, 2)
        assert used.state[0].tobytes() == fresh.state[0].tobytes()
        for actions in script(2, 40):
            used.step(np.stack([actions, actions]))
            fresh.step(np.stack([actions, actions]))
        assert used.state[0].tobytes() == fresh.state[0].tobytes()
        assert used.impact[0].tobytes() == fresh.impact[0].tobytes()
        assert used.time[0] == fresh.time[0] == pytest.approx(4.0)

    def test_resetting_one_race_leaves_the_others_alone(self) -> None:
        world = World(LINDENRING, GT3, 2, 4)
        race(world, 0, 1)
        race(world, 1, 2)
        before = world.state[1].tobytes()
        race(world, 0, 3)
        assert world.state[1].tobytes() == before

    def test_actions_are_clipped_to_their_range(self) -> None:
        ends = []
        for throttle, steering in ((1.0, -1.0), (7.0, -3.0)):
            world = world_with(stadium(), [100.0], speed=20.0)
            ends.append(drive(world, throttle, steering, seconds=1.0).tobytes())
        assert ends[0] == ends[1]


class TestCourse:
    """The stadium is 20 m to the edge, and its kerbs are 1 m wide; tyres stand at most 0.835 m aside."""

    @staticmethod
    def out(lateral: float, heading: float = 0.0, track: Track | None = None) -> int:
        world = world_with(track or stadium(), [1000.0], lateral=lateral, heading=heading)
        grip, drag = np.empty(4), np.empty(4)
        count = stand_on(world.state[0, 0], grip, drag, world.parameters, course_parameters(world.track))
        assert (grip == np.where(drag > 0.05, 0.55, 1.0)).all()
        assert (grip < 1.0).sum() == count
        return int(count)

    @pytest.mark.parametrize(
        ("lateral", "heading", "count"),
        [
            (0.0, 0.0, 0),
            (20.1, 0.0, 0),  # all on road and kerb: the left tyres at 20.93
            (20.5, 0.0, 2),
            (21.5, 0.3, 3),  # the right rear tyre is still on the kerb, at 20.31
            (21.2, 0.3, 2),
            (20.0, 0.3, 1),
            (22.0, 0.0, 4),
        ],
    )
    def test_tyres_out_of_bounds(self, lateral: float, heading: float, count: int) -> None:
        assert self.out(lateral, heading) == count
        assert self.out(-lateral, -heading) == count

    @given(st.floats(-30.0, 30.0), st.floats(-3.1, 3.1))
    @settings(deadline=None, max_examples=60)
    def test_tyres_out_of_bounds_wherever_the_car_stands(self, lateral: float, heading: float) -> None:
        body = GT3.body
        wheels = [
            (x, side * track / 2)
            for x, track in ((body.front_axle_m, body.front_track_m), (-body.rear_axle_m, body.rear_track_m))
            for side in (1, -1)
        ]
        across = np.array([lateral + x * np.sin(heading) + y * np.cos(heading) for x, y in wheels])
        # A tyre within a millimetre of the kerb's edge may be taken either way.
        if np.abs(np.abs(across) - 21.0).min() > 1e-3:
            assert self.out(lateral, heading) == (np.abs(across) > 21.0).sum()

    def test_three_tyres_out_are_off_course_and_two_are_not(self) -> None:
        for lateral, heading, off in ((21.5, 0.3, True), (21.2, 0.3, False)):
            world = world_with(stadium(), [1000.0], lateral=lateral, heading=heading)
            car = drive(world, 0.0, seconds=0.5)[0, 0]
            assert bool(car["off_course"]) is off
            assert car["off_course_s"] == pytest.approx(0.5 if off else 0.0)

    def test_the_flag_falls_and_the_time_stays_when_back_on_the_road(self) -> None:
        world = world_with(stadium(), [1000.0], lateral=23.0, speed=20.0, heading=-0.3)
        drive(world, 0.2, seconds=0.2)
        assert world.state[0, 0]["off_course"]
        car = drive(world, 0.2, seconds=1.5)[0, 0]
        assert not car["off_course"]
        assert 0.2 < car["off_course_s"] < 0.5


class TestLaps:
    @staticmethod
    def timed(progress: list[float], start: float, length: float = 1000.0, finish: float = np.inf) -> np.void:
        """A car after being seen at each progress in turn, a dynamics step apart from time 0."""
        car = np.zeros(1, CAR_STATE)
        for unset in ("line_s", "last_lap_s", "best_lap_s", "finish_s"):
            car[unset] = np.nan
        car["start"], car["finish"], car["driving"], car["progress"] = start, finish, True, progress[0]
        course = course_parameters(circle(length / (2 * np.pi)))._replace(length=length)
        for step, (before, after) in enumerate(pairwise(progress)):
            car["progress"] = after
            time_laps(car[0], before, step * DYNAMICS_DT, DYNAMICS_DT, course)
        return car[0]

    @given(st.floats(20.0, 90.0), st.floats(-100.0, -1.0))
    @settings(deadline=None, max_examples=30)
    def test_constant_speed_is_timed_exactly(self, speed: float, start: float) -> None:
        steps = int(550.0 / speed / DYNAMICS_DT)
        car = self.timed([start + speed * DYNAMICS_DT * i for i in range(steps)], start, length=200.0)
        assert car["laps"] == (start + speed * DYNAMICS_DT * (steps - 1)) // 200.0
        assert car["last_lap_s"] == pytest.approx(200.0 / speed, abs=1e-9)
        assert car["line_s"] == pytest.approx((200.0 * car["laps"] - start) / speed, abs=1e-9)
        assert car["best_lap_s"] == pytest.approx(200.0 / speed, abs=1e-9)

    def test_best_is_the_quickest_and_last_the_latest(self) -> None:
        speeds = [50.0] * 1300 + [60.0] * 1000 + [40.0] * 1500
        progress = (np.cumsum(speeds) * DYNAMICS_DT - 10.0).tolist()
        car = self.timed(progress, -10.0)
        assert car["laps"] == 3
        assert car["best_lap_s"] < 1000.0 / 50.0
        assert car["last_lap_s"] > 1000.0 / 50.0

    def test_a_start_past_the_line_has_no_lap_time_before_a_full_lap(self) -> None:
        progress = [30.0 + i for i in range(1500)]
        car = self.timed(progress, 30.0)
        assert car["laps"] == 1
        assert np.isnan(car["last_lap_s"])
        assert np.isfinite(car["line_s"])

    def test_back_over_the_line_and_forth_again_counts_nothing(self) -> None:
        there = [-10.0 + i for i in range(31)]
        car = self.timed([*there, *there[::-1], *there], -10.0)
        first = self.timed(there, -10.0)
        assert car["laps"] == 0
        assert car["line_s"] == first["line_s"] == pytest.approx(10 * DYNAMICS_DT)
        assert np.isnan(car["last_lap_s"])
        around = [5.0 + i for i in range(1010)]
        car = self.timed([*around, *around[:980:-1], *around[980:]], 5.0)
        assert car["laps"] == 1

    def test_driving_the_wrong_way_round_counts_nothing(self) -> None:
        car = self.timed([-10.0 - i for i in range(2500)], -10.0)
        assert car["laps"] == 0
        assert np.isnan(car["line_s"])

    def test_a_start_on_the_line_counts_laps(self) -> None:
        car = self.timed([float(i) for i in range(1500)], 0.0)
        assert car["laps"] == 1

    def test_finish_is_timed_by_interpolation(self) -> None:
        car = self.timed([float(i) for i in range(0, 200, 2)], -1.0, finish=101.0)
        assert not car["driving"]
        assert car["finish_s"] == pytest.approx(50.5 * DYNAMICS_DT)

    def test_a_rolling_car_is_timed_to_a_millisecond(self) -> None:
        world = world_with(stadium(), [-30.0], speed=50.0)
        before = after = world.state[0, 0]
        while np.isnan(after["line_s"]):
            before = world.state[0, 0].copy()
            after = drive(world, 0.2)[0, 0]
        # Within one agent step the acceleration is even: the crossing lies on a parabola.
        push = (after["velocity_x"] - before["velocity_x"]) / AGENT_DT
        gap, speed = -before["progress"], before["velocity_x"]
        crossing = world.time[0] - AGENT_DT + (np.sqrt(speed**2 + 2 * push * gap) - speed) / push
        assert after["line_s"] == pytest.approx(crossing, abs=1e-3)

    def test_the_first_start_is_kept_across_a_lap_of_the_circle(self) -> None:
        track = circle(30.0, half_width=20.0, wall=25.0)
        world = World(track, GT3, 1, 2)
        world.reset(0, start_at([-10.0, 10.0], speed=10.0, lateral=[2.0, -2.0]))
        for _ in range(500):
            cars = world.state[0]
            wanted = 2.65 / (30.0 - cars["lateral"]) - 0.3 * cars["heading_error"]
            actions = np.stack([10.0 - cars["velocity_x"] + 0.04, wanted / 0.36 + 0.02], axis=1)
            world.step(actions[None])
        gone = cars["progress"] / track.length
        assert gone.min() > 2.0
        assert cars["laps"].tolist() == np.floor(gone).astype(int).tolist()
        assert cars["start"] == pytest.approx([-10.0, 10.0], abs=0.01)


class TestDone:
    def test_a_finished_car_is_neither_hit_nor_seen_nor_moved(self) -> None:
        world = world_with(stadium(), [1000.0, 950.0], speed=50.0, finish=1001.0)
        drive(world, 0.5)
        first, second = world.state[0]
        assert not first["driving"]
        assert second["driving"]
        assert first["finish_s"] == pytest.approx(1.0 / 50.0, abs=1e-3)
        second["finish"] = np.inf
        spec = ObservationSpec(course_points=1, cars_ahead=1, cars_behind=0)
        seen = world.observe(spec, np.array([0]), np.array([1]))[0, spec.slice("cars_ahead")]
        assert seen[0] < 0.0, "present is standardised: below 0 is no"
        place = (float(first["x"]), float(first["y"]))
        drive(world, 0.5, seconds=2.0)
        assert second["x"] > first["x"] + 10.0
        assert (first["x"], first["y"]) == place
        assert second["contacts"] == 0
        assert second["draught"] == 0.0

    def test_stationary_time_counts_from_the_last_motion(self) -> None:
        world = world_with(stadium(), [1000.0, 900.0], speed=[0.0, 20.0])
        drive(world, 0.0, seconds=3.0)
        assert world.state["stationary_s"][0] == pytest.approx([3.0, 0.0])
        drive(world, 1.0, seconds=1.0)
        assert world.state["stationary_s"][0].tolist() == [0.0, 0.0]
