"""The world: same seed, same bits, whatever the batch; off course; cars that are done."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from nathlon.sim.conditions import Conditions
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.physics.course import facing, stand_on
from nathlon.sim.physics.tyre import Ground
from nathlon.sim.reaction import Perception, Reaction
from nathlon.sim.rules import Serving, load_rules
from nathlon.sim.state import CAR_STATE, CONTACT
from nathlon.sim.track import Track
from nathlon.sim.world import World
from tests.support.driving import GT3, drive, road, stadium, start_at, world_with

CARS = 4
FIELDS = CAR_STATE.names or ()
FLAGS = ("off_course", "wall_contact", "car_contact")


def hilly() -> Track:
    """A winding, banked and hilly road with kerbs, gravel and penalty zones, walls close by."""
    angle = np.linspace(0.0, 2 * np.pi, 240, endpoint=False)
    radius = 120.0 + 12.0 * np.sin(3 * angle)
    return road(
        radius * np.cos(angle),
        radius * np.sin(angle),
        5.0,
        9.0,
        z=4.0 * np.sin(2 * angle),
        bank=0.1 * np.sin(angle),
        kerb=({"side": "left", "start_m": 50.0, "end_m": 300.0, "width_m": 1.0},),
        runoff_stretch=({"side": "right", "start_m": 100.0, "end_m": 500.0, "surface": "gravel"},),
        penalty_zone=({"start_m": 200.0, "end_m": 350.0}, {"start_m": 500.0, "end_m": 600.0}),
    )


HILLY = hilly()


def new_world(races: int, threads: int = 1) -> World:
    """Races in which everything goes on at once: rules, wear, fuel, walls, contacts."""
    conditions = Conditions(wear_rate=50.0, fuel_rate=20.0)
    rules = load_rules("sporting").model_copy(update={"serving": Serving(speed_m_s=8.0)})
    return World(HILLY, GT3, races, CARS, conditions, rules, threads)


def start_race(world: World, index: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    distance = rng.uniform(0.0, HILLY.length) - 7.0 * np.arange(CARS)
    lateral, heading, speed = rng.uniform((-2.0, -0.1, 5.0), (2.0, 0.1, 30.0), (CARS, 3)).T
    world.reset(index, start_at(distance.tolist(), lateral.tolist(), speed.tolist(), heading.tolist()))


def script(seed: int, steps: int) -> NDArray[np.float64]:
    """Actions of cars that hit each other and the walls, (steps, CARS, 2)."""
    return np.random.default_rng(seed).uniform((-0.3, -0.5), (1.0, 0.5), (steps, CARS, 2))


def bits(world: World, race: int) -> bytes:
    """All that a race is after a step: states, contacts, time, and what its cars see."""
    cars = np.arange(CARS)
    seen = world.observe(ObservationSpec(course_points=16), np.full(CARS, race), cars)
    notes = world.new_contacts(race)
    parts = [world.state[race][name] for name in FIELDS] + [notes[name] for name in CONTACT.names or ()]
    return b"".join(part.tobytes() for part in [*parts, seen, world.ticks[race]])


def run(world: World, actions: NDArray[np.float64]) -> Iterator[None]:
    """Step through the actions of every race, (steps, races, CARS, 2)."""
    for now in actions:
        world.step(now)
        yield


def story(seed: int, steps: int) -> list[bytes]:
    """What a race alone in its world is after each step."""
    world = new_world(1)
    start_race(world, 0, seed)
    return [bits(world, 0) for _ in run(world, script(seed, steps)[:, None])]


class TestDeterminism:
    STEPS = 120

    def test_same_start_and_actions_give_the_same_bits(self) -> None:
        assert story(7, self.STEPS) == story(7, self.STEPS)
        assert story(7, self.STEPS) != story(8, self.STEPS)

    @pytest.mark.parametrize("threads", [1, 2, 3])
    def test_a_race_depends_on_neither_batch_nor_slot_nor_threads(self, threads: int) -> None:
        # Seven races do not divide evenly among threads; each seed stands in another slot each time.
        seeds = np.roll(np.arange(7), threads).tolist()
        world = new_world(7, threads)
        for slot, seed in enumerate(seeds):
            start_race(world, slot, seed)
        stories: list[list[bytes]] = [[] for _ in seeds]
        for _ in run(world, np.stack([script(seed, self.STEPS) for seed in seeds], axis=1)):
            for slot in range(7):
                stories[slot].append(bits(world, slot))
        for happened in ("contacts", "wall_s", "off_course_s", "penalties"):
            assert (world.state[happened] > 0).any(), f"the test needs races with {happened}"
        for slot, seed in enumerate(seeds):
            assert stories[slot] == story(seed, self.STEPS)

    @pytest.mark.parametrize("threads", [2, 5])
    def test_more_threads_than_races_do_no_harm(self, threads: int) -> None:
        world = new_world(1, threads)
        start_race(world, 0, 7)
        assert [bits(world, 0) for _ in run(world, script(7, 20)[:, None])] == story(7, 20)

    def test_a_race_driven_again_from_its_logged_actions_is_the_same(self) -> None:
        # Actions that depend on what is seen, logged in float32 as a log would have them.
        world, logged, spec = new_world(1), [], ObservationSpec(course_points=8)
        start_race(world, 0, 3)
        mix = np.random.default_rng(3).normal(0.0, 0.3, (spec.size, 2))
        first = []
        for _ in range(self.STEPS):
            seen = world.observe(spec, np.zeros(CARS, np.int64), np.arange(CARS))
            logged.append(np.tanh(seen @ mix + [0.5, 0.0]).astype(np.float32))
            world.step(logged[-1][None])
            first.append(bits(world, 0))
        again = new_world(3)
        for slot in range(3):
            start_race(again, slot, 3 if slot == 1 else slot)
        for actions, wanted in zip(logged, first, strict=True):
            again.step(np.broadcast_to(actions, (3, CARS, 2)))
            assert bits(again, 1) == wanted

    @pytest.mark.parametrize("split", [(1, 1, 1, 1, 1, 1), (2, 2, 2), (1, 5), (4, 2)])
    def test_steps_may_be_split_at_will(self, split: tuple[int, ...]) -> None:
        whole, parts = new_world(1), new_world(1)
        for seed in (6, 7):
            start_race(whole, 0, seed)
            start_race(parts, 0, seed)
            whole.state["penalty_s"] = parts.state["penalty_s"] = 30.0
            for now in script(seed, self.STEPS):
                whole.step(now[None])
                noted = []
                for substeps in split:
                    parts.step(now[None], substeps)
                    noted.append(parts.new_contacts(0).copy())
                for name in FIELDS:
                    # Flags are those of the last step, which is another one.
                    if name not in FLAGS:
                        assert whole.state[name].tobytes() == parts.state[name].tobytes(), name
                assert (np.concatenate(noted) == whole.new_contacts(0)).all()
                assert whole.ticks == parts.ticks
            assert (whole.state["penalty_s"] < 30.0).any(), "the test needs a penalty that is served"

    def test_reset_leaves_nothing_of_the_run_before(self) -> None:
        world = new_world(2)
        start_race(world, 0, 1)
        start_race(world, 1, 1)
        noted = 0
        for _ in run(world, np.stack([script(1, self.STEPS)] * 2, axis=1)):
            noted = int(world.contact_count[0])
            if noted:
                break
        assert noted
        start_race(world, 0, 2)
        assert len(world.new_contacts(0)) == 0
        assert world.time[0] == 0.0
        happened = [bits(world, 0) for _ in run(world, np.stack([script(2, 40)] * 2, axis=1))]
        assert happened == story(2, 40)
        assert world.time[0] == pytest.approx(4.0)

    def test_resetting_one_race_leaves_the_others_alone(self) -> None:
        world = new_world(2)
        start_race(world, 0, 1)
        start_race(world, 1, 2)
        before = bits(world, 1)
        start_race(world, 0, 3)
        assert bits(world, 1) == before

    def test_actions_are_clipped_to_their_range(self) -> None:
        ends = []
        for throttle, steering in ((1.0, -1.0), (7.0, -3.0)):
            world = world_with(stadium(), [100.0], speed=20.0)
            ends.append(drive(world, throttle, steering, seconds=1.0).tobytes())
        assert ends[0] == ends[1]


class TestPerception:
    """A car is seen as it was some dynamics steps ago, however its race shares the world."""

    SPEC = ObservationSpec(course_points=4)

    @pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.2, 0.05])
    def test_each_car_sees_what_was_some_steps_ago(self, delay_s: float) -> None:
        reaction = Reaction.of(np.full(CARS, 10.0), np.array([0.0, delay_s, delay_s, 0.3]))
        world = new_world(2)
        races, cars = np.repeat([0, 1], CARS), np.tile(np.arange(CARS), 2)
        perception = Perception(self.SPEC, races, cars, reaction)
        for race in range(2):
            start_race(world, race, race)
        truth = []
        late = np.tile(reaction.delay // reaction.tick, 2)
        restarted = 37
        for step in range(80):
            if step == restarted:
                # The second race starts anew, and sees nothing of the one before.
                start_race(world, 1, 5)
            truth.append(world.observe(self.SPEC, races, cars))
            seen = perception.see(world)
            for row in range(2 * CARS):
                since = 0 if races[row] == 0 or step < restarted else restarted
                assert seen[row].tobytes() == truth[max(step - late[row], since)][row].tobytes()
            world.step(np.stack([script(9, 80)[step]] * 2), reaction.tick)

    def test_the_tick_meets_every_action_and_every_delay(self) -> None:
        mixed = Reaction.of(np.array([10.0, 60.0, 20.0]), np.array([0.0, 0.1, 0.25]))
        assert mixed.period.tolist() == [6, 1, 3]
        assert mixed.delay.tolist() == [0, 6, 15]
        assert mixed.tick == 1
        assert Reaction.of(np.array([10.0, 5.0]), np.array([0.2, 0.0])).tick == 6
        assert Reaction.of(np.array([10.0, 5.0]), np.array([0.15, 0.0])).tick == 3

    def test_cars_are_due_at_their_own_rates(self) -> None:
        reaction = Reaction.of(np.array([10.0, 20.0, 60.0, 5.0]), np.zeros(CARS))
        world = new_world(1)
        start_race(world, 0, 0)
        perception = Perception(self.SPEC, np.zeros(CARS, np.int64), np.arange(CARS), reaction)
        due = np.zeros(CARS, np.int64)
        for _ in range(60):
            due += perception.due(world)
            world.step(np.zeros((1, CARS, 2)), reaction.tick)
        assert due.tolist() == [10, 20, 60, 5]


class TestCourse:
    """The stadium is 20 m to the edge, without kerbs here or with ones of 1 m; tyres stand 0.835 m aside."""

    @staticmethod
    def kerbed() -> Track:
        angle = np.linspace(0.0, 2 * np.pi, 720, endpoint=False)
        kerbs = (
            {"side": side, "start_m": 0.0, "end_m": 6000.0, "width_m": 1.0} for side in ("left", "right")
        )
        return road(1000 * np.cos(angle), 1000 * np.sin(angle), 20.0, 40.0, kerb=tuple(kerbs))

    KERBED = kerbed()

    def stand(self, lateral: float, heading: float) -> tuple[int, NDArray[np.float64], NDArray[np.float64]]:
        world = world_with(self.KERBED, [1000.0], lateral=lateral, heading=heading)
        ground, p = Ground(*np.empty((3, 4))), world.parameters
        car = world.state[0, 0]
        count = stand_on(car, *facing(car, p.course), False, ground, p.car, p.course)
        return int(count), ground.grip, ground.shake

    @given(st.floats(-30.0, 30.0), st.floats(-3.1, 3.1))
    @settings(deadline=None, max_examples=100)
    def test_each_tyre_stands_on_what_lies_under_it(self, lateral: float, heading: float) -> None:
        body = GT3.body
        wheels = [
            (x, side * track / 2)
            for x, track in ((body.front_axle_m, body.front_track_m), (-body.rear_axle_m, body.rear_track_m))
            for side in (1, -1)
        ]
        # On 1 km radius, a wheel's distance from the centre tells its place.
        inward = 1000.0 - lateral
        across = np.array(
            [
                1000.0
                - np.hypot(
                    inward - x * np.sin(heading) - y * np.cos(heading),
                    x * np.cos(heading) - y * np.sin(heading),
                )
                for x, y in wheels
            ]
        )
        # A tyre within some millimetres of an edge may be taken either way.
        if min(np.abs(np.abs(across) - edge).min() for edge in (20.0, 21.0)) < 0.01:
            return
        count, grip, shake = self.stand(lateral, heading)
        off, kerb = np.abs(across) > 21.0, (np.abs(across) > 20.0) & (np.abs(across) < 21.0)
        assert count == off.sum()
        np.testing.assert_array_equal(grip, np.where(off, 0.55, np.where(kerb, 0.92, 1.0)))
        assert (shake[~kerb] == 1.0).all()
        assert (np.abs(shake[kerb] - 1.0) <= 0.2 + 1e-12).all()

    @pytest.mark.parametrize(("lateral", "off"), [(0.0, False), (20.5, False), (22.0, True)])
    def test_off_course_is_flagged_and_timed(self, lateral: float, off: bool) -> None:
        world = world_with(self.KERBED, [1000.0], lateral=lateral, speed=5.0)
        car = drive(world, 0.1, seconds=0.5)[0, 0]
        assert car["off_course"] == off
        assert car["off_course_s"] == pytest.approx(0.5 if off else 0.0)

    def test_the_flag_falls_and_the_time_stays_when_back_on_the_road(self) -> None:
        world = world_with(stadium(), [1000.0], lateral=23.0, speed=20.0, heading=-0.3)
        drive(world, 0.2, seconds=0.2)
        assert world.state[0, 0]["off_course"]
        car = drive(world, 0.2, seconds=1.5)[0, 0]
        assert not car["off_course"]
        assert 0.2 < car["off_course_s"] < 0.6


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

    def test_a_start_may_lie_before_the_line_or_laps_on(self) -> None:
        track = stadium()
        world = World(track, GT3, 1, 3)
        world.reset(0, start_at([-30.0, 40.0, 2 * track.length + 50.0]))
        np.testing.assert_allclose(
            world.state[0]["progress"], [-30.0, 40.0, 2 * track.length + 50.0], atol=1e-6
        )
        assert world.state[0]["laps"].tolist() == [0, 0, 2]
