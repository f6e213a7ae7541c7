"""Games in turn, actions in several parts: who is asked when, what is heard, what is allowed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.spaces import Box, Discrete, MultiDiscrete

from nathlon.arena.team import Absent
from nathlon.arena.watch import Watch
from nathlon.arena.worlds.environment import GymnasiumWorld, PettingZooWorld
from nathlon.arena.worlds.host import InTurn
from nathlon.arena.worlds.player import Asking, idle
from nathlon.arena.worlds.rehearsal import farama_says
from nathlon.policies.general import load_general

THREE = ("ann", "bob", "cid")


class Rounds:
    """Three add a number each, three times; who has said 0 is out. Each gets what the next one says."""

    possible_agents = THREE

    def observation_space(self, _: str) -> Any:
        return Box(0.0, 9.0, (1,))

    def action_space(self, _: str) -> Any:
        return Discrete(4)

    def agent_iter(self) -> Any: ...

    def close(self) -> None: ...

    def reset(self, seed: int | None = None) -> None:
        self.agents, self.turn, self.said = list(THREE), 0, 0
        self.agent_selection = "ann"
        self.gains, self.over = dict.fromkeys(THREE, 0.0), dict.fromkeys(THREE, False)

    def last(self) -> Any:
        name = self.agent_selection
        seen = np.full(1, self.said, np.float32)
        return seen, self.gains[name], self.over[name], False, {"turns": self.turn}

    def step(self, action: Any) -> None:
        name = self.agent_selection
        place = self.agents.index(name)
        if self.over[name]:
            assert action is None
            self.agents.remove(name)
        else:
            self.gains[name], self.said, self.turn = 0.0, int(action), self.turn + 1
            self.gains[self.agents[place - 1]] += self.said
            self.over[name] = action == 0 or self.turn >= 9
            if self.turn >= 9:
                self.over = dict.fromkeys(THREE, True)
            place += 1
        self.agent_selection = self.agents[place % len(self.agents)] if self.agents else ""


def played(world: Any, policies: list[Any], seats: int) -> tuple[list[float], list[str]]:
    """Scores and faults of the seats in an episode."""
    [scenario] = world.scenarios
    players = [
        Asking(policy, str(seat), seen, done, np.random.default_rng(seat), 1, 1.0).watched(Watch(), 0, seat)
        for seat, policy, (seen, done) in zip(range(seats), policies, world.spaces(scenario), strict=True)
    ]
    outcomes = world.play(scenario, players, 1)
    return [one.score for one in outcomes], [player.fault for player in players]


def says(path: Path, number: int, times: int = 9) -> str:
    file = path / f"{number}-{times}.pt"
    file.write_text(f"{number} {times}")
    return str(file)


class Sayer:
    """Says a number so many times, then 0."""

    def __init__(self, path: Path) -> None:
        self.number, self.times = map(int, path.read_text().split())

    def act(self, observation: Any, memory: Any) -> Any:
        steps = memory or 0
        return self.number if steps < self.times else 0, steps + 1


def test_seats_play_in_turn_and_hear_of_what_they_got_meanwhile(tmp_path: Path) -> None:
    world = PettingZooWorld({"rounds": Rounds}, load=lambda path, seen, done: Sayer(path))
    who = [world.policy(says(tmp_path, number)) for number in (1, 2, 3)]
    # Each gets three times what the next one says.
    assert played(world, who, 3) == ([6.0, 9.0, 3.0], [""] * 3)


def test_who_is_out_plays_no_more_and_the_others_go_on(tmp_path: Path) -> None:
    world = PettingZooWorld(
        {"rounds": Rounds}, load=lambda path, seen, done: Sayer(path), score=lambda seat: seat.steps
    )
    who = [world.policy(says(tmp_path, *said)) for said in ((1, 9), (2, 1), (3, 9))]
    assert played(world, who, 3)[0] == [4.0, 2.0, 3.0]


def test_an_environment_in_turn_is_told_from_others() -> None:
    assert isinstance(PettingZooWorld({"rounds": Rounds}).made("rounds"), InTurn)


def test_pettingzoo_tests_the_game_in_turn_itself() -> None:
    from pettingzoo.classic import tictactoe_v3

    said = farama_says(PettingZooWorld({"game": tictactoe_v3.env}, episode="game"), "game")
    assert said == [
        "PettingZoo's api_test passes, but warns: Observation numpy array is all zeros.",
        "PettingZoo's seed_test passes.",
    ]


def test_random_moves_and_those_of_who_has_failed_are_legal() -> None:
    """Tic-tac-toe ends a game at an illegal move, with -1 for who made it."""
    from pettingzoo.classic import tictactoe_v3

    world = PettingZooWorld({"game": tictactoe_v3.env}, episode="game")
    spaces_of: Any = world.spaces("game")[0]
    random = load_general("random", *spaces_of)
    for policies in ([random, random], [random, Absent("timed_out")]):
        for _ in range(3):
            scores, faults = played(world, policies, 2)
            assert sum(scores) == 0.0
            assert faults == ["", "timed_out" if policies[1] is not random else ""]


class Pairs:
    """Points for a pair of choices; observations are a pair as well."""

    observation_space = spaces.Tuple((Discrete(3), Box(0.0, 1.0, (2,))))
    action_space = spaces.Tuple((Discrete(3), MultiDiscrete([2, 2])))

    def reset(self, seed: int | None = None, options: Any = None) -> Any:
        return (2, np.zeros(2, np.float32)), {}

    def step(self, action: Any) -> Any:
        first, rest = action
        return (2, np.zeros(2, np.float32)), float(first + rest.sum()), True, False, {}


def test_observations_and_actions_may_be_tuples(tmp_path: Path) -> None:
    def load(path: Path, seen: Any, done: Any) -> Any:
        return lambda observation: (observation[0], np.ones(2, np.int64))

    world: Any = GymnasiumWorld({"pairs": Pairs}, load=load)
    random = load_general("random", Pairs.observation_space, Pairs.action_space)
    assert played(world, [world.policy(says(tmp_path, 0))], 1) == ([4.0], [""])
    assert played(world, [random], 1)[1] == [""]
    assert played(world, [Absent("timed_out")], 1) == ([0.0], ["timed_out"])


@pytest.mark.parametrize(
    ("mask", "done"), [([False, True, True], 1), ([False] * 3, 0), ([True] * 2, 0), (None, 0)]
)
def test_who_idles_does_what_is_allowed(mask: list[bool] | None, done: int) -> None:
    assert idle(Discrete(3), None if mask is None else np.array(mask)) == done
