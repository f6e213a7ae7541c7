"""Populations of opponents: how often each is drawn, and who `self` and `past` are."""

from __future__ import annotations

import numpy as np
import pytest

from nathlon.policies import bundled
from nathlon.policies.checkpoint import NetworkPolicy, load_checkpoint
from nathlon.policies.environments.opponents import OpponentWrapper
from nathlon.policies.policy import Batch
from nathlon.policies.training.config import Opponent, Rollouts, TrainingConfig
from nathlon.policies.training.pairs import Pair
from nathlon.policies.training.population import Population
from nathlon.policies.training.rollout import Rollout
from nathlon.sim.episode import Episodes
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec

BUNDLED = sorted((bundled.BUNDLED / "lindenring").glob("*.safetensors"))[:3]
PAIR = Pair("lindenring", "gt3")


def population(*opponents: str | tuple[str, float]) -> Population:
    entries = [
        Opponent(policy=o) if isinstance(o, str) else Opponent(policy=o[0], weight=o[1]) for o in opponents
    ]
    return Population(entries, PAIR)


class Constant:
    """Always the same action; counts its calls and the cars in each."""

    observation_spec = ObservationSpec(course_points=1, cars_ahead=1, cars_behind=0)

    def __init__(self, throttle: float) -> None:
        self.throttle = throttle
        self.calls: list[int] = []

    def initial_memory(self, n: int) -> Batch:
        return np.zeros((n, 1), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        self.calls.append(len(observations))
        assert observations.shape == (len(memory), self.observation_spec.size)
        return np.tile(np.array([self.throttle, 0.0], np.float32), (len(memory), 1)), memory + 1.0


def test_policies_are_drawn_by_their_weights() -> None:
    drawn = population("driver", ("driver:pace=0.9", 3.0)).draw(4000, np.random.default_rng(0))
    # Of 4,000 draws a quarter is 1,000 with a deviation of 27.
    assert abs(np.bincount(drawn)[0] - 1000) < 5 * 27


def test_self_and_past_are_who_they_are_called() -> None:
    rng = np.random.default_rng(0)
    crowd = population("self", "driver:pace=0.9", "past")
    driver = crowd.policies[1]
    assert crowd.policies == [driver] * 3
    learner = Constant(1.0)
    assert crowd.meet(learner, [], rng) == [0]
    assert crowd.policies == [learner, driver, driver]
    assert crowd.meet(learner, BUNDLED[:1], rng) == [2]
    past = crowd.policies[2]
    assert isinstance(past, NetworkPolicy)
    assert past.id == load_checkpoint(BUNDLED[0]).id
    # Nothing is new.
    assert crowd.meet(None, BUNDLED[:1], rng) == []
    assert crowd.policies == [learner, driver, past]


def test_past_is_any_of_the_checkpoints() -> None:
    rng = np.random.default_rng(0)
    crowd = population("driver", "past")
    met = set()
    for turn in range(40):
        crowd.meet(None, BUNDLED if turn % 2 else BUNDLED[:2], rng)
        past = crowd.policies[1]
        assert isinstance(past, NetworkPolicy)
        met.add(past.id)
    assert met == {load_checkpoint(path).id for path in BUNDLED}


def test_an_unknown_opponent_is_refused() -> None:
    with pytest.raises(InputError, match="nobody"):
        population("driver", "nobody.safetensors")


class TestOpponentWrapper:
    def wrapper(self, *policies: Constant, races: int = 4) -> OpponentWrapper:
        episodes = Episodes("lindenring", "gt3", "1v3", races)
        return OpponentWrapper(episodes, [3], ObservationSpec(course_points=1), policies)

    def start(self, wrapper: OpponentWrapper, races: list[int]) -> None:
        wrapper.start(races, [np.random.default_rng(race) for race in races])

    def test_all_cars_of_a_policy_act_in_one_call(self) -> None:
        a, b = Constant(1.0), Constant(-1.0)
        wrapper = self.wrapper(a, b)
        self.start(wrapper, [0, 1, 2, 3])
        wrapper.step(np.zeros((4, 2), np.float32))
        wrapper.seat([0, 2], np.array([[0, 0, 0], [0, 0, 1]]))
        self.start(wrapper, [0, 2])
        wrapper.step(np.zeros((4, 2), np.float32))
        assert (a.calls, b.calls) == ([6, 7], [6, 5])
        braking = wrapper.episodes.world.state["brake"] > 0.5
        assert braking.tolist() == [
            [False, False, False, False],
            [True, False, True, False],
            [False, False, True, False],
            [True, False, True, False],
        ]

    def test_a_start_forgets_what_was_remembered_there_only(self) -> None:
        a = Constant(1.0)
        wrapper = self.wrapper(a, races=2)
        self.start(wrapper, [0, 1])
        for _ in range(3):
            wrapper.step(np.zeros((2, 2), np.float32))
        self.start(wrapper, [1])
        wrapper.step(np.zeros((2, 2), np.float32))
        assert wrapper._opponents[0]._memory[:, 0].tolist() == [4.0] * 3 + [1.0] * 3

    def test_another_policy_takes_over(self) -> None:
        a, b, c = Constant(1.0), Constant(-1.0), Constant(-0.5)
        c.observation_spec = ObservationSpec(course_points=3)
        wrapper = self.wrapper(a, b)
        self.start(wrapper, [0, 1, 2, 3])
        wrapper.step(np.zeros((4, 2), np.float32))
        wrapper.replace(0, c)
        wrapper.step(np.zeros((4, 2), np.float32))
        assert (a.calls, b.calls, c.calls) == ([6], [6, 6], [6])
        assert sorted(set(wrapper.episodes.world.state["brake"].ravel().tolist())) == [0.0, 0.5, 1.0]


CONFIG = TrainingConfig.model_validate(
    {
        "circuit": "lindenring",
        "car": "gt3",
        "updates": 8,
        "updates_per_step": 2,
        "warm_up": 60,
        "replay": 500,
        "checkpoint_every": 4,
        "opponents": ["driver:pace=0.8", {"policy": "self", "weight": 2.0}, "past"],
        "rollouts": [{"scenario": "1v3", "races": 6, "learners": 1, "mistakes": 0.5}],
        "observation": {"course_points": 3, "cars_ahead": 1, "cars_behind": 1},
    }
)


def experience(seed: int) -> list[bytes]:
    """What a rollout with all kinds of opponents and starts makes of random actions."""
    rollout = Rollout(CONFIG, CONFIG.rollouts[0], PAIR, np.random.default_rng(seed))
    rng = np.random.default_rng(100)
    made = []
    for step in range(150):
        if step == 20:
            rollout.meet(Constant(0.7), BUNDLED)
        rollout.episodes.limit_s[:] = np.minimum(rollout.episodes.limit_s, rollout.episodes.world.time + 6.0)
        taken, _ = rollout.step(rng.uniform([0.2, -0.3], [1.0, 0.3], (6, 2)).astype(np.float32))
        made.append(b"".join(part.tobytes() for part in taken))
    assert len(rollout._mistakes) > 0
    return made


def test_the_same_seed_gives_the_same_experience() -> None:
    assert experience(1) == experience(1)
    assert experience(1) != experience(2)


def test_a_restart_from_a_mistake_has_the_full_time() -> None:
    rollout = Rollout(CONFIG, CONFIG.rollouts[0], PAIR, np.random.default_rng(1))
    rng = np.random.default_rng(0)
    again = 0
    for _ in range(200):
        time = rollout.episodes.world.time.copy()
        rollout.step(rng.uniform([0.2, -0.3], [1.0, 0.3], (6, 2)).astype(np.float32))
        left = rollout.episodes.limit_s - rollout.episodes.world.time
        begun = np.abs(rollout.episodes.world.time - time - 0.1) > 1e-9
        np.testing.assert_allclose(left[begun], 150.0)
        again += int((begun & (rollout.episodes.world.time > 0.0)).sum())
        rollout.episodes.limit_s[:] = np.minimum(
            rollout.episodes.limit_s, rollout.episodes.world.time + rng.uniform(3.0, 30.0, 6)
        )
    assert again > 0


class TestPlaces:
    def cars(self, **settings: object) -> list[int]:
        rollouts = Rollouts.model_validate({"scenario": "1v3", "races": 1, "learners": 1, **settings})
        rollout = Rollout(CONFIG, rollouts, PAIR, np.random.default_rng(0))
        return rollout._learners.tolist()

    def test_learners_start_from_the_last_place_or_from_those_given(self) -> None:
        assert self.cars() == [3]
        assert self.cars(learners=2) == [0, 3]
        assert self.cars(places=[1]) == [0]
        assert self.cars(learners=2, places=[3, 2]) == [1, 2]

    @pytest.mark.parametrize(
        ("settings", "complaint"),
        [
            ({"learners": 5}, "rollouts 1v3: learners is 5, expected at most the scenario's 4 cars"),
            ({"places": [5]}, "rollouts 1v3: places has 5, expected at most the scenario's 4"),
            ({"perception_delay_s": [0.1, 0.1]}, "rollouts 1v3: perception_delay_s has 2 numbers, expected"),
        ],
    )
    def test_more_than_there_are_is_refused(self, settings: dict[str, object], complaint: str) -> None:
        with pytest.raises(InputError, match=complaint):
            self.cars(**settings)


def test_a_delay_of_its_own_takes_the_place_of_the_scenarios() -> None:
    rollouts = CONFIG.rollouts[0].model_copy(update={"perception_delay_s": 0.2})
    rollout = Rollout(CONFIG, rollouts, PAIR, np.random.default_rng(0))
    seen = [rollout.observation]
    for _ in range(4):
        step, _ = rollout.step(np.full((6, 2), 0.1, np.float32))
        seen.append(step.next_observation)
    # Two steps pass before anything but the start is seen.
    np.testing.assert_array_equal(seen[1], seen[0])
    np.testing.assert_array_equal(seen[2], seen[0])
    assert not np.array_equal(seen[3], seen[0])


def test_rates_of_its_own_wear_tyres_and_empty_tanks() -> None:
    rollouts = CONFIG.rollouts[0].model_copy(update={"wear_rate": 200.0, "fuel_rate": 50.0})
    rollout = Rollout(CONFIG, rollouts, PAIR, np.random.default_rng(0))
    full = rollout.episodes.world.state["fuel"].max()
    for _ in range(20):
        rollout.step(np.full((6, 2), 0.5, np.float32))
    cars = rollout.episodes.world.state
    assert cars["wear"].max() > 0.0
    assert cars["fuel"].min() < full
