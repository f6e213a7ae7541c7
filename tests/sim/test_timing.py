"""Laps, sectors, finishes and gaps, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from nathlon.sim.clock import AGENT_DT, DYNAMICS_DT
from nathlon.sim.kernel import kernel
from nathlon.sim.physics.course import CourseParameters, course_parameters
from nathlon.sim.state import CAR_STATE
from nathlon.sim.timing import SECTORS, first_line, gaps, time_lines
from nathlon.sim.world import World
from tests.support.driving import GT3, circle, drive, stadium, start_at, world_with

LENGTH = 1000.0
LINES = (0.0, 250.0, 600.0)


def course(length: float = LENGTH, lines: tuple[float, ...] = LINES) -> CourseParameters:
    """A course of which only the timing lines matter."""
    return course_parameters(circle(100.0))._replace(length=length, sectors=np.array(lines))


def new_car(start: float, finish: float = np.inf) -> NDArray[np.void]:
    """One car at its start, m."""
    car = np.zeros(1, CAR_STATE)
    for unset in ("line_s", "sector_s", "last_lap_s", "best_lap_s", "finish_s"):
        car[unset] = np.nan
    car["start"] = car["progress"] = start
    car["line"] = first_line(np.array([start]), LINES, LENGTH)
    car["laps"] = max(int(start // LENGTH), 0)
    car["finish"], car["driving"] = finish, True
    return car


@kernel
def follow(car: np.ndarray, progress: np.ndarray, course: CourseParameters) -> None:
    """Time a car that is seen at each progress in turn, a dynamics step apart from time 0."""
    for step in range(len(progress) - 1):
        car[0].progress = progress[step + 1]
        time_lines(car[0], progress[step], step * DYNAMICS_DT, DYNAMICS_DT, course)


def timed(progress: list[float], finish: float = np.inf) -> np.void:
    """A car after it has followed some way."""
    car = new_car(progress[0], finish)
    follow(car, np.array(progress, np.float64), course())
    return car[0]


class TestLines:
    @given(st.floats(20.0, 90.0), st.floats(-900.0, 900.0), st.floats(0.0, 3000.0))
    @settings(deadline=None, max_examples=60)
    def test_constant_speed_is_timed_exactly(self, speed: float, start: float, way: float) -> None:
        count = 2 + int(way / (speed * DYNAMICS_DT))
        car = timed([start + speed * DYNAMICS_DT * i for i in range(count)])
        end = start + speed * DYNAMICS_DT * (count - 1)
        for sector, line in enumerate(LINES):
            # The last lap in which the line lies between start and end.
            lap = np.floor((end - line) / LENGTH)
            place = lap * LENGTH + line
            if start < place - 1e-6 and place + 1e-6 < end:
                assert car["line_s"][sector] == pytest.approx((place - start) / speed, abs=1e-9)
            elif place < start - 1e-6:
                assert np.isnan(car["line_s"][sector])
        if start + 2 * LENGTH < end:
            lengths = np.diff([*LINES, LENGTH])
            np.testing.assert_allclose(car["sector_s"], lengths / speed, rtol=0, atol=1e-9)
            assert car["last_lap_s"] == pytest.approx(LENGTH / speed, abs=1e-9)
            assert car["best_lap_s"] == pytest.approx(LENGTH / speed, abs=1e-9)

    @given(st.integers(0, 2**32))
    @settings(deadline=None, max_examples=60)
    def test_sectors_sum_to_the_lap_at_any_speed(self, seed: int) -> None:
        # Back at times, and to 2100 m, so that the last sectors are those of the last lap.
        steps = np.random.default_rng(seed).uniform(-0.2, 2.0, 4000)
        progress = np.cumsum(steps) - 10.0
        progress = progress[: np.argmax(progress > 2 * LENGTH + 100.0)]
        car = timed(progress.tolist())
        assert car["laps"] == 2
        # Times are differences of seconds since the start: a sum of three errs by rounding.
        assert car["sector_s"].sum() == pytest.approx(car["last_lap_s"], abs=1e-12)
        # The crossing itself by numpy, on the way as a broken line.
        first = [np.argmax(progress >= line) for line in (LENGTH, 2 * LENGTH)]
        crossed = [
            (i - 1 + (line - progress[i - 1]) / (progress[i] - progress[i - 1])) * DYNAMICS_DT
            for i, line in zip(first, (LENGTH, 2 * LENGTH), strict=True)
        ]
        assert car["last_lap_s"] == pytest.approx(crossed[1] - crossed[0], abs=1e-9)

    def test_best_is_the_quickest_and_last_the_latest(self) -> None:
        speeds = [50.0] * 1300 + [60.0] * 1000 + [40.0] * 1500
        car = timed((np.cumsum(speeds) * DYNAMICS_DT - 10.0).tolist())
        assert car["laps"] == 3
        assert car["best_lap_s"] < 1000.0 / 50.0
        assert car["last_lap_s"] > 1000.0 / 50.0

    def test_a_start_past_the_line_has_no_lap_time_before_a_full_lap(self) -> None:
        car = timed([30.0 + i for i in range(1500)])
        assert car["laps"] == 1
        assert np.isnan(car["last_lap_s"])
        assert np.isnan(car["sector_s"][0]) == (car["progress"] < LENGTH + LINES[1])
        assert np.isfinite(car["sector_s"][1:]).all()

    @pytest.mark.parametrize("turn", LINES)
    def test_back_over_a_line_and_forth_again_counts_nothing(self, turn: float) -> None:
        there = [turn - 20.0 + i for i in range(41)]
        once, again = timed(there), timed([*there, *there[::-1], *there])
        assert again["laps"] == once["laps"] == 0
        assert again["line"] == once["line"]
        np.testing.assert_array_equal(again["line_s"], once["line_s"])
        assert np.nanmax(once["line_s"]) == pytest.approx(20 * DYNAMICS_DT)

    def test_back_over_the_end_of_a_lap_counts_it_once(self) -> None:
        around = [5.0 + i for i in range(1010)]
        assert timed([*around, *around[:980:-1], *around[980:]])["laps"] == 1

    def test_driving_the_wrong_way_round_counts_nothing(self) -> None:
        car = timed([-10.0 - i for i in range(2500)])
        assert car["laps"] == 0
        assert np.isnan(car["line_s"]).all()

    def test_a_start_on_the_line_counts_laps(self) -> None:
        assert timed([float(i) for i in range(1500)])["laps"] == 1

    @pytest.mark.parametrize(
        ("start", "line"),
        [(-1200.0, -3), (-1.0, 0), (0.0, 1), (249.0, 1), (250.0, 2), (999.0, 3), (1000.0, 4)],
    )
    def test_first_line_is_the_next_one_ahead(self, start: float, line: int) -> None:
        # Counted from the line of lap 0: the second sector begins at 1, the third at 2.
        assert first_line(np.array([start]), LINES, LENGTH).tolist() == [line]


class TestFinish:
    @given(st.floats(10.0, 90.0), st.floats(50.0, 150.0))
    @settings(deadline=None, max_examples=40)
    def test_it_is_timed_by_interpolation(self, speed: float, finish: float) -> None:
        car = timed([speed * DYNAMICS_DT * i for i in range(1200)], finish)
        assert not car["driving"]
        assert car["finish_s"] == pytest.approx(finish / speed, abs=1e-9)

    def test_a_penalty_that_was_not_served_is_added(self) -> None:
        car = new_car(99.0, finish=100.0)
        car["penalty_s"], car["progress"] = 2.5, 101.0
        time_lines(car[0], 99.0, 10.0, DYNAMICS_DT, course())
        assert car[0]["finish_s"] == pytest.approx(10.0 + 0.5 * DYNAMICS_DT + 2.5, abs=1e-12)
        assert car[0]["penalty_s"] == 2.5

    def test_a_lap_that_ends_at_the_finish_has_its_time(self) -> None:
        car = timed([-1.0 + 0.7 * i for i in range(1500)], finish=LENGTH)
        assert car["last_lap_s"] == pytest.approx(LENGTH / 0.7 * DYNAMICS_DT, abs=1e-9)
        assert car["finish_s"] == pytest.approx(car["line_s"][0], abs=1e-12)


class TestGaps:
    @given(st.lists(st.floats(-40.0, -1.0), min_size=2, max_size=6, unique=True), st.floats(10.0, 1900.0))
    @settings(deadline=None, max_examples=60)
    def test_cars_of_one_speed_are_as_far_apart_as_at_the_start(
        self, starts: list[float], way: float
    ) -> None:
        steps = int(way)
        cars = np.array([timed([start + i for i in range(steps)]) for start in starts])
        behind = (max(starts) - np.array(starts)) * DYNAMICS_DT
        crossed = cars["line"] > 0
        np.testing.assert_allclose(gaps(cars)[crossed], behind[crossed], atol=1e-9)
        assert np.isnan(gaps(cars)[~crossed]).all()

    def test_a_car_a_lap_behind_has_none(self) -> None:
        leader = timed([-1.0 + 2 * i for i in range(1100)])
        near = timed([-1.0 + 1.5 * i for i in range(1100)])
        lapped = timed([-1.0 + 0.9 * i for i in range(1100)])
        seen = gaps(np.array([lapped, leader, near]))
        assert np.isnan(seen[0])
        assert seen[1] == 0.0
        # Its last line is that of 1600 m, 1601 m from its start.
        assert seen[2] == pytest.approx(1601.0 * (1 / 1.5 - 1 / 2.0) * DYNAMICS_DT, abs=1e-9)

    def test_nor_has_one_that_the_leader_has_just_lapped(self) -> None:
        cars = np.zeros(2, CAR_STATE)
        cars["line"], cars["line_s"] = [2 * SECTORS + 1, SECTORS + 1], [[40.0, 20.0, 30.0], [35.0, 5.0, 15.0]]
        assert np.isnan(gaps(cars)[1])
        cars["line"][1] += 1
        cars["line_s"][1, 1] = 41.0
        assert gaps(cars).tolist() == [0.0, 21.0]

    def test_finishers_are_apart_by_their_times_though_the_later_stopped_further_on(self) -> None:
        first = timed([-0.1 + 1.0 * i for i in range(1200)], finish=LENGTH)
        second = timed([-3.0 + 1.4 * i for i in range(100)] + [136.0 + 0.9 * i for i in range(1200)], LENGTH)
        assert second["progress"] > first["progress"]
        late = second["line_s"][0] - first["line_s"][0]
        assert late > 0.0
        assert gaps(np.array([second, first])).tolist() == [late, 0.0]

    def test_nobody_has_one_before_the_first_line(self) -> None:
        assert np.isnan(gaps(np.array([timed([-9.0, -8.0]), timed([-5.0, -4.0])]))).all()


class TestWorld:
    def test_a_rolling_car_is_timed_to_a_millisecond(self) -> None:
        world = world_with(stadium(), [-30.0], speed=50.0)
        before = after = world.state[0, 0]
        while np.isnan(after["line_s"][0]):
            before = world.state[0, 0].copy()
            after = drive(world, 0.2)[0, 0]
        # Within one agent step the acceleration is even: the crossing lies on a parabola.
        push = (after["velocity_x"] - before["velocity_x"]) / AGENT_DT
        gap, speed = -before["progress"], before["velocity_x"]
        crossing = world.time[0] - AGENT_DT + (np.sqrt(speed**2 + 2 * push * gap) - speed) / push
        assert after["line_s"][0] == pytest.approx(crossing, abs=1e-3)

    def test_laps_follow_the_way_round_a_circle(self) -> None:
        track = circle(30.0, half_width=20.0, wall=25.0)
        world = World(track, GT3, 1, 2)
        world.reset(0, start_at([-10.0, 10.0], speed=10.0, lateral=[2.0, -2.0]))
        for _ in range(500):
            cars = world.state[0]
            lane = np.array([2.0, -2.0])
            wanted = 2.65 / 30.0 - 0.05 * (cars["lateral"] - lane) - 0.5 * cars["heading_error"]
            pace = 10.0 - cars["velocity_x"] + 0.04
            actions = np.stack([pace, wanted / GT3.steering.full_lock_rad], axis=1)
            world.step(actions[None])
        gone = cars["progress"] / track.length
        assert gone.min() > 2.0
        assert cars["laps"].tolist() == np.floor(gone).astype(int).tolist()
        assert cars["start"] == pytest.approx([-10.0, 10.0], abs=0.01)
        # Once the pace is even a lap takes its way over the speed along the centre line.
        around = track.length * (1 - cars["lateral"] / 30.0) / cars["velocity_x"]
        np.testing.assert_allclose(cars["last_lap_s"], around, rtol=0.01)
        assert (cars["line"] == np.floor(gone * SECTORS) + 1).all()
