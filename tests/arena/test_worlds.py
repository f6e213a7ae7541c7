"""Worlds of environments: the rows of their episodes, and what becomes of policies and worlds that fail."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from nathlon.arena.entrance import check_world, enter_all
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.results import INTERRUPTED, RESULTS
from nathlon.arena.team import Absent
from nathlon.arena.watch import Watch
from nathlon.arena.world import Outcome, World
from nathlon.arena.world_finding import offered_worlds
from nathlon.arena.world_registry import load_world
from nathlon.arena.worlds.episodes import place_points, placed, score_points
from nathlon.arena.worlds.loaded import LoadedPolicy
from nathlon.arena.worlds.racing import surroundings
from nathlon.sim.data_file import DATA
from tests.support.games import box_player, player, refused, world_of

MAKER = """
class Maker:
    def __call__(self):
        from envs import duel

        return duel()


maker = Maker()
"""
DUEL = "PettingZooWorld({'duel': envs['duel']}, points='place')"


class Failing:
    """A policy that fails when it is asked for the third time."""

    precise = False

    def __init__(self, answer: Any) -> None:
        self.asked, self.answer = 0, answer

    def initial_memory(self, n: int) -> Any:
        return np.zeros((n, 0), np.float32)

    def act(self, observations: Any, memory: Any) -> Any:
        self.asked += 1
        if self.asked == 3 and isinstance(self.answer, BaseException):
            raise self.answer
        return observations, memory

    def decode(self, row: Any, space: Any, rng: Any, mask: Any) -> Any:
        return self.answer if self.asked >= 3 else int(row.argmax())


def play(
    world: World, policies: Sequence[Any], seats: Sequence[int], seeds: Sequence[int] = (1,)
) -> pl.DataFrame:
    """RESULTS of episodes of the world's first scenario, with these policies in the seats."""
    scenario = world.scenarios[0]
    names = tuple(f"policy {index}" for index in range(len(policies)))
    taken = tuple(Seat(policy) for policy in seats)
    races = tuple(Race(seed, taken) for seed in seeds)
    match = Match("test", scenario, scenario, "", "", names, names, races, world.name)
    [(number, rows)] = world.run({7: (match, list(policies))}, Watch())
    assert number == 7
    assert rows.schema == RESULTS
    return rows


def policies_of(world: World, folder: Path, *rights: int) -> list[Any]:
    return [world.policy(player(folder / f"{right}.onnx", right)) for right in rights]


def test_the_better_policy_has_the_better_place(tmp_path: Path) -> None:
    world = load_world(world_of(tmp_path, DUEL))
    rows = play(world, policies_of(world, tmp_path, 3, 0), (0, 1))
    # Six steps; who alone is right gets a half of a point, and the other one loses as much.
    assert rows["score"].to_list() == [3.0, -3.0]
    assert rows["place"].to_list() == [1, 2]
    assert rows["points"].to_list() == [10.0, 8.0]
    assert rows["ending"].to_list() == ["finished", "finished"]
    assert rows["entrant"].to_list() == ["policy 0", "policy 1"]


def test_a_draw_shares_places_and_points(tmp_path: Path) -> None:
    world = load_world(world_of(tmp_path, DUEL))
    rows = play(world, policies_of(world, tmp_path, 3), (0, 0))
    assert rows["place"].to_list() == [1, 1]
    assert rows["points"].to_list() == [9.0, 9.0]


def test_places_and_points_follow_from_outcomes() -> None:
    outcomes = [Outcome(2.0), Outcome(5.0), Outcome(2.0), Outcome(9.0)]
    assert placed(outcomes, [False] * 4) == [3, 2, 3, 1]
    assert placed(outcomes, [False, False, False, True]) == [2, 1, 2, 4], (
        "who fails is last, whatever its score"
    )
    assert placed([Outcome(place=2), Outcome(place=1)], [False, False]) == [2, 1]
    assert place_points([1, 1, 3]) == [9.0, 9.0, 6.0]
    assert place_points(list(range(1, 11)))[-3:] == [1.0, 0.0, 0.0]
    assert score_points(outcomes, [False, False, False, True]) == [2.0, 5.0, 2.0, -5.0]
    assert score_points(outcomes, [True, False, False, False]) == [2.0, 5.0, 2.0, 9.0]
    assert score_points([Outcome(1.0), Outcome(3.0)], [True, False]) == [1.0, 3.0]
    assert score_points([Outcome(1.0), Outcome(3.0)], [True, True]) == [1.0, 1.0]


def test_a_team_gets_the_same_and_background_seats_are_the_baseline_s(tmp_path: Path) -> None:
    team = load_world(
        world_of(tmp_path, "PettingZooWorld({'t': envs['team']}, sides=[['a', 'b']])", "team.py")
    )
    assert team.setup("t").sides == ((0, 1),)
    rows = play(team, policies_of(team, tmp_path, 3, 0), (0, 1))
    assert rows["points"].to_list() == [3.0, 3.0]
    sides = "[['hunter_1', 'hunter_2'], ['prey']]"
    chase = load_world(
        world_of(tmp_path, f"PettingZooWorld({{'c': envs['chase']}}, sides={sides})", "chase.py")
    )
    setup = chase.setup("c")
    assert setup.seats == ("hunter_1", "hunter_2", "prey", "tree")
    assert setup.sides == ((0, 1), (2,))


def test_a_world_of_one_seat_keeps_its_measures(tmp_path: Path) -> None:
    measures = "{'steps': Declared('steps', 'steps', 'min'), 'contacts': Declared(lambda seat: seat.steps)}"
    made = f"GymnasiumWorld({{'only': envs['Alone']}}, measures={measures})"
    world = load_world(world_of(tmp_path, made))
    rows = play(world, policies_of(world, tmp_path, 3), (0,))
    assert rows["score"].to_list() == [6.0]
    assert rows["measures"].to_list() == ['{"steps": 6.0}']
    assert rows["contacts"].to_list() == [6]
    assert rows["ending"].to_list() == ["time_up"], "a time limit is no end of the episode's own"
    assert world.measures["contacts"].goal == "min", "known measures are what they are"


def test_who_leaves_early_keeps_its_row(tmp_path: Path) -> None:
    world = load_world(world_of(tmp_path, "PettingZooWorld({'l': envs['leaves']})"))
    rows = play(world, policies_of(world, tmp_path, 0, 3), (0, 1))
    assert rows["ending"].to_list() == ["finished", "finished"]
    assert rows["score"][1] == 1.0, "two steps of a half"


@pytest.mark.parametrize(
    ("answer", "ending"),
    [
        (ValueError("no"), "policy_raised"),
        (SystemExit(1), "policy_raised"),
        (5, "illegal_action"),
        (np.array([np.nan]), "illegal_action"),
    ],
)
def test_a_policy_that_fails_is_out_and_the_others_play_on(tmp_path: Path, answer: Any, ending: str) -> None:
    world = load_world(world_of(tmp_path, DUEL))
    rows = play(world, [Failing(answer), *policies_of(world, tmp_path, 0)], (0, 1))
    assert rows["ending"].to_list() == [ending, "finished"]
    assert rows["place"].to_list() == [2, 1], "it is last, although it had led"
    assert rows["points"][0] <= rows["points"][1]


def test_an_absent_policy_is_out_from_the_start(tmp_path: Path) -> None:
    world = load_world(world_of(tmp_path, DUEL))
    rows = play(world, [Absent("timed_out"), *policies_of(world, tmp_path, 3)], (0, 1))
    assert rows["ending"].to_list() == ["timed_out", "finished"]


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("nan", "step 2: seat 'left': observation with NaN, expected numbers"),
        ("shape", "step 2: seat 'left': observation of 4 numbers, expected 3"),
        ("forgets", "step 5: seat 'left': no reward, expected that of its last step"),
        (
            "old",
            "step 0: seat 'left': gives 4 values, expected observation, reward, terminated, truncated, info",
        ),
        ("score", "seat 'right': score is nan, expected a finite number"),
        ("huge", "seat 'right': score is 1e+300, expected 1e+100 at most in size"),
        ("raises", "step 3: KeyError ('no such light')"),
    ],
)
def test_a_fault_of_the_world_makes_the_episode_void(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, fault: str, said: str
) -> None:
    name = world_of(tmp_path, f"PettingZooWorld({{'duel': envs['faulty']('{fault}')}})")
    world = load_world(name)
    rows = play(world, policies_of(world, tmp_path, 3, 0), (0, 1))
    assert set(rows["ending"]) == {"simulator_fault"}
    assert f"world {name!r}, scenario 'duel': {said}: the episode is void" in caplog.text


def test_a_nan_is_the_fault_of_the_world_whoever_is_shown_it(tmp_path: Path) -> None:
    """Policies of the world's own loader are shown observations as they are."""
    world = load_world(world_of(tmp_path, "PettingZooWorld({'duel': envs['faulty']('nan')})"))
    (tmp_path / "own.pt").write_text("own")

    def load(*_: Any) -> Any:
        return lambda observation: int(np.nan_to_num(observation).argmax())

    loaded = LoadedPolicy.read(str(tmp_path / "own.pt"), load, *world.spaces("duel")[0])  # type: ignore[attr-defined]
    rows = play(world, [loaded, *policies_of(world, tmp_path, 0)], (0, 1))
    assert set(rows["ending"]) == {"simulator_fault"}


def test_episodes_do_not_depend_on_those_before(tmp_path: Path) -> None:
    world = load_world(world_of(tmp_path, DUEL))
    policies = [world.policy("random"), *policies_of(world, tmp_path, 2)]
    together = play(world, policies, (0, 1), seeds=(3, 4, 3))
    scores = together["score"].to_numpy().reshape(3, 2)
    assert (scores[0] == scores[2]).all()
    assert (scores[0] != scores[1]).any()


def test_what_decides_is_the_world_s_files_and_versions(tmp_path: Path) -> None:
    name = world_of(tmp_path, "PettingZooWorld({'duel': envs['duel']}, packages=('pettingzoo',))")
    told = load_world(name).facts("duel")["world_files"]
    assert set(told["files"]) == {"envs.py", "worlds.py"}
    assert set(told["packages"]) == {"numpy", "pettingzoo", "python"}


@pytest.mark.parametrize(
    ("scenario", "file"),
    [
        ("partial(envs['Game'], 'a', 'b')", None),
        ("maker", "maker.py"),
        ("partial(maker)", "maker.py"),
        ("eval('lambda: duel()', envs)", None),
    ],
)
def test_a_scenario_may_be_anything_that_is_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scenario: str, file: str | None
) -> None:
    # Beside the world it would count in any case.
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.syspath_prepend(elsewhere)
    (elsewhere / "maker.py").write_text(MAKER)
    name = world_of(tmp_path, f"PettingZooWorld({{'duel': {scenario}}})")
    path = tmp_path / "worlds.py"
    path.write_text(f"from functools import partial\nfrom maker import maker\n{path.read_text()}")
    world = load_world(name)
    assert len(world.setup("duel").seats) == 2
    assert set(world.facts("duel")["world_files"]["files"]) == {"worlds.py", file} - {None}


def test_a_world_that_hangs_is_stopped_in_the_time_that_it_says(tmp_path: Path, pool: Pool) -> None:
    name = world_of(tmp_path, "PettingZooWorld({'duel': envs['hangs']}, answer_s=0.5)")
    source = player(tmp_path / "good.onnx", 3)
    identity = load_world(name).enter(source).id
    races = (Race(1, (Seat(0), Seat(0))),)
    [(_, rows)] = pool.run([Match("test", "duel", "duel", "", "", (identity,), (source,), races, name)])
    assert set(rows["ending"]) == {INTERRUPTED}  # it sleeps: the machine may have been to blame


def test_policies_that_do_not_fit_are_refused(tmp_path: Path, pool: Pool) -> None:
    name = world_of(tmp_path, DUEL)
    check_world(pool, name)
    fitting, other = player(tmp_path / "good.onnx", 3), box_player(tmp_path / "box.safetensors")
    [entrant] = enter_all(pool, [fitting], "", "", name)
    assert (entrant.name, entrant.world, entrant.circuit) == ("good", name, "")
    with refused("action space is Discrete(3), expected Box"):
        enter_all(pool, [fitting, other], "", "", name)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nothing", "world 'nothing': expected racing, MODULE:NAME or PATH.py:NAME"),
        ("missing.py:world", "missing.py: no such file, expected a world"),
        ("json:nothing", "world 'json:nothing': json has no 'nothing'"),
        ("json:loads", "world 'json:loads': cannot be loaded: TypeError"),
        ("json:decoder", "world 'json:decoder': has no scenarios, expected a world"),
        ("no_such_package:world", "world 'no_such_package:world': cannot be loaded: ModuleNotFoundError"),
    ],
)
def test_what_is_no_world_is_refused_with_a_sentence(name: str, said: str) -> None:
    with refused(said):
        load_world(name)


def test_unknown_seats_and_scenarios_are_refused(tmp_path: Path, pool: Pool) -> None:
    made = "PettingZooWorld({'duel': envs['duel']}, sides=[['left'], ['middle']])"
    name = world_of(tmp_path, made)
    with refused(f"world {name!r}, scenario 'duel': has no seat 'middle', expected left, right"):
        check_world(pool, name)
    with refused("scenario is 'chess', expected duel"):
        load_world(name).setup("chess")
    missing = world_of(tmp_path, "PettingZooWorld({'duel': lambda: __import__('not_there')})", "missing.py")
    with refused("scenario 'duel': cannot be made: ModuleNotFoundError (No module named 'not_there')"):
        check_world(pool, missing)


def test_our_own_world_is_always_offered() -> None:
    assert offered_worlds()[0] == "racing"


@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        ("pole_m = -12.0", "pole_m = -20.0"),
        ("lateral_m = 2.6", "lateral_m = 1.6"),
        ("[grid]", '[pit_lane]\nside = "right"\nentry_m = 4000.0\nexit_m = 150.0\n\n[grid]'),
    ],
)
def test_what_lies_along_a_circuit_decides_what_its_races_come_to(
    tmp_path: Path, was: str, becomes: str
) -> None:
    """Stored matches of a file that has changed are other ones."""
    shutil.copytree(DATA / "circuits" / "lindenring", tmp_path / "own")
    file = tmp_path / "own" / "circuit.toml"
    text = file.read_text()
    assert was in text
    file.write_text(text.replace(was, becomes))
    own, shipped = (surroundings("sprint", circuit, "gt3") for circuit in (str(file), "lindenring"))
    assert own["track"] == shipped["track"]
    assert own != shipped
