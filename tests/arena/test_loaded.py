"""Policies that a world's own code makes of files: what they are shown and may answer, what is refused."""

from __future__ import annotations

import json
import os
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Dict, Discrete

import nathlon
from nathlon.arena.entrance import enter_all, enter_each
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.watch import Watch
from nathlon.arena.world import World
from nathlon.arena.world_registry import load_world
from nathlon.arena.worlds.loaded import LoadedPolicy, by_ending, loader_of
from nathlon.policies.sources.finding import find_sources
from nathlon.selection.config import Config
from nathlon.selection.matrix_settings import MatrixSettings
from nathlon.selection.nightly.watching import watch
from nathlon.sim.errors import InputError
from nathlon.sim.process import has_ended
from tests.support.games import ENVIRONMENTS, WORLD, refused

LOADERS = '''
import json


class Names:
    """Names so many of the three lights rightly; a file is `{"right": 2}`."""

    def __init__(self, path):
        self.right = json.loads(Path(path).read_text())["right"]

    def __call__(self, observation):
        light = int(observation.argmax())
        return light if light < self.right else (light + 1) % 3


def plain(path, observation_space, action_space):
    return Names(path)


class Counts:
    """Right in every second step: it counts its steps, either in a memory or in itself."""

    def act(self, observation, memory):
        steps = memory or 0
        light = int(observation.argmax())
        return (light + steps % 2) % 3, steps + 1


class CountsItself:
    def reset(self, seed):
        self.steps = 0

    def __call__(self, observation):
        self.steps += 1
        return (int(observation.argmax()) + (self.steps - 1) % 2) % 3


def counts(path, observation_space, action_space):
    return Counts()


def counts_itself(path, observation_space, action_space):
    return CountsItself()


def broken(path, observation_space, action_space):
    return json.loads(Path(path).read_text())["left"]


def nothing(path, observation_space, action_space):
    return None


def wrong(path, observation_space, action_space):
    return lambda observation: 3.5
'''


def world_with(folder: Path, load: str, made: str = "'duel': envs['duel']") -> World:
    """A world of the lights whose policies are loaded by an expression of LOADERS."""
    (folder / "envs.py").write_text(ENVIRONMENTS)
    lines = f"{WORLD}\n{LOADERS}\nworld = PettingZooWorld({{{made}}}, load={load})\n"
    (folder / "worlds.py").write_text(lines)
    return load_world(f"{folder / 'worlds.py'}:world")


def names(folder: Path, right: int, ending: str = ".pt") -> str:
    path = folder / f"{right}{ending}"
    path.write_text(json.dumps({"right": right}))
    return str(path)


def scores(world: World, policies: Sequence[Any], seats: Sequence[int], seeds: int = 1) -> list[float]:
    scenario = world.scenarios[0]
    called = tuple(map(str, range(len(policies))))
    races = tuple(Race(seed, tuple(map(Seat, seats))) for seed in range(seeds))
    match = Match("test", scenario, scenario, "", "", called, called, races, world.name)
    [(_, rows)] = world.run({0: (match, list(policies))}, Watch())
    assert rows["ending"].is_in(["finished"]).all(), rows["ending"]
    return rows["score"].to_list()


def test_a_function_of_one_observation_is_a_policy(tmp_path: Path) -> None:
    world = world_with(tmp_path, "plain")
    best, worst = (world.policy(names(tmp_path, right)) for right in (3, 0))
    assert scores(world, [best, worst], (0, 1)) == [3.0, -3.0]


@pytest.mark.parametrize("load", ["counts", "counts_itself"])
def test_a_policy_with_a_memory_begins_anew_in_every_episode_and_seat(tmp_path: Path, load: str) -> None:
    """Both seats of the team see the same steps: a count that they shared would be wrong in all."""
    world = world_with(tmp_path, load, "'team': envs['team']")
    policy = world.policy(names(tmp_path, 3))
    assert scores(world, [policy], (0, 0), seeds=2) == [3.0] * 4


def test_an_ending_has_a_loader_of_its_own(tmp_path: Path) -> None:
    """Also one that nathlon reads itself."""
    world = world_with(tmp_path, "{'.onnx': plain, '.BIN': plain}")
    assert scores(
        world, [world.policy(names(tmp_path, 3, ".onnx")), world.policy(names(tmp_path, 0, ".bin"))], (0, 1)
    ) == [3.0, -3.0]
    with refused(".pt"):
        world.policy(names(tmp_path, 1))


def test_the_longest_ending_counts() -> None:
    def first(path: Path, observed: Any, done: Any) -> None: ...

    def second(path: Path, observed: Any, done: Any) -> None: ...

    loaders = by_ending({".pkl": first, "module_state.pkl": second})
    assert loader_of(loaders, "run/MODULE_STATE.pkl") is second
    assert loader_of(loaders, "run/other.pkl") is first
    assert loader_of(loaders, "run/other.zip") is None
    with pytest.raises(ValueError, match="expected an ending of files and a function"):
        by_ending({".pt": "no function"})


@pytest.mark.parametrize(
    ("load", "said"),
    [
        ("broken", "broken raised KeyError ('left'), expected a policy"),
        ("nothing", "nothing gives NoneType, expected what is called with an observation"),
        ("wrong", "shown an observation, gives [3.5], expected whole numbers"),
    ],
)
def test_what_gives_no_policy_is_refused_by_its_file(tmp_path: Path, load: str, said: str) -> None:
    source = names(tmp_path, 3)
    with refused(f"{source}: {said}"):
        world_with(tmp_path, load).policy(source)


def test_files_enter_by_their_contents_and_the_loader_s_file_decides_episodes(tmp_path: Path) -> None:
    world = world_with(tmp_path, "plain")
    with Pool(1) as pool:
        first, second = enter_all(pool, [names(tmp_path, 1), names(tmp_path, 2)], "", "", world.name)
    assert (first.name, second.name) == ("1", "2")
    assert first.id != second.id
    before = world.facts("duel")
    loader = tmp_path / "elsewhere.py"
    loader.write_text(
        textwrap.dedent(LOADERS.replace("import json", "import json\nfrom pathlib import Path"))
    )
    (tmp_path / "other").mkdir()
    there = world_with(tmp_path / "other", f"runpy.run_path({str(loader)!r})['plain']")
    assert "elsewhere.py" in there.facts("duel")["world_files"]["files"]
    assert "elsewhere.py" not in before["world_files"]["files"]


class Both(torch.nn.Module):
    """Scores of three choices for an observation of two parts; the dropout counts in training alone."""

    def __init__(self) -> None:
        super().__init__()
        self.dropout = torch.nn.Dropout(0.9)

    def forward(self, seen: dict[str, torch.Tensor]) -> torch.Tensor:
        assert seen["light"].shape == (1, 3)
        assert seen["mask"].dtype == torch.int8
        return self.dropout(seen["light"]).masked_fill(seen["mask"] == 0, -torch.inf)


def test_a_module_of_torch_is_shown_observations_as_they_are(tmp_path: Path) -> None:
    parts: dict[str, Any] = {"light": Box(0.0, 1.0, (3,)), "mask": Box(0, 1, (3,), dtype=np.int8)}
    observed, done = Dict(parts), Discrete(3)
    policy = LoadedPolicy.read(names(tmp_path, 3), lambda *_: Both(), observed, done)
    seated = policy.of_seat(0)
    light = np.array([0.2, 0.9, 0.5], np.float32)
    rng = np.random.default_rng(0)
    assert seated.act({"light": light, "mask": parts["mask"].high}, done, rng) == 1
    masked = parts["mask"].high.copy()
    masked[1] = 0
    assert seated.act({"light": light, "mask": masked}, done, rng) == 2


def test_a_module_s_numbers_are_clipped_to_a_box(tmp_path: Path) -> None:
    observed, done = Box(-1.0, 1.0, (2,)), Box(-0.5, 0.5, (1, 2))
    module = torch.nn.Linear(2, 2)
    torch.nn.init.eye_(module.weight)
    torch.nn.init.zeros_(module.bias)
    policy = LoadedPolicy.read(names(tmp_path, 3), lambda *_: module, observed, done)
    rng = np.random.default_rng(0)
    action = policy.of_seat(0).act(np.array([-0.25, 1.0], np.float32), done, rng)
    assert action.tolist() == [[-0.25, 0.5]]
    both = torch.nn.LSTM(2, 2)
    with pytest.raises(InputError, match="the module gives tuple, expected one tensor"):
        LoadedPolicy.read(names(tmp_path, 3), lambda *_: both, observed, done)


def test_folders_hold_what_the_world_s_code_reads(tmp_path: Path) -> None:
    world = world_with(tmp_path, "plain")
    folder = tmp_path / "runs"
    folder.mkdir()
    for right in range(3):
        names(folder, right)
    (folder / "notes.txt").write_text("nothing to load")
    result = nathlon.select(folder, tmp_path / "out", world=world.name, workers=1, progress=False)
    assert result.sent == ["2"]
    assert result.ranking["name"].to_list()[0] == "2"
    with refused(f"{folder}: holds 3 files such as '0.pt'", "load=function in another world's mapping"):
        find_sources([folder])
    watched = watch([str(folder)], world.loaders)
    assert len(watched.digests) == 3
    (tmp_path / "one").mkdir()
    own = Path(names(tmp_path / "one", 1))
    with refused(f"{own}: is the baseline, expected another policy"):
        settings = Config(world=world.name, matrix=MatrixSettings(scenarios=("duel",)))
        nathlon.matrix(own.parent, baseline=own.parent, config=settings, workers=1, progress=False)


HOSTILE = '''
import os
import time
from pathlib import Path


class Beyond(BaseException):
    """No Exception."""


def hostile(path, observation_space, action_space):
    what = Path(path).read_text()
    if what == "fork":
        os.fork()
    if what == "stay" and (forked := os.fork()) == 0:
        time.sleep(1e6)
    if what == "stay":
        Path(path).with_name("forked").write_text(str(forked))
    if what == "move":
        os.chdir("/")
    if what == "raise":
        raise Beyond
    if what == "exit":
        os._exit(0)
    return lambda observation: int(observation.argmax())
'''


@pytest.mark.skipif(os.name != "posix", reason="forks")
def test_a_hostile_loader_costs_its_own_file_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.arena.test_loaded.LOADERS", HOSTILE)
    world = world_with(tmp_path, "hostile")
    monkeypatch.chdir(tmp_path)
    sources = []
    for what in ("fork", "stay", "move", "raise", "exit", "good"):
        sources.append(f"{what}.pt")
        Path(sources[-1]).write_text(what)
    with Pool(1) as pool:
        answers = dict(zip(sources, enter_each(pool, sources, "", "", world.name), strict=True))
        forked = int((tmp_path / "forked").read_text())
    said = {
        Path(source).stem: str(answer) for source, answer in answers.items() if isinstance(answer, InputError)
    }
    assert said.keys() == {"raise", "exit"}
    for name, sentence in said.items():
        assert sentence == f"{name}.pt: ended the process that opened it, expected a policy"
    assert has_ended(forked)
