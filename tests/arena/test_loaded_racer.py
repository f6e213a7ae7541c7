"""Files of other libraries in our own races: a loader that is named reads them."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from nathlon.api.selection import configured
from nathlon.arena.job import MatchJob
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.runner import run_match
from nathlon.arena.serving import do
from nathlon.arena.watch import Watch
from nathlon.arena.world import World
from nathlon.arena.world_finding import find_world, in_folder
from nathlon.arena.world_registry import load_world
from nathlon.arena.worlds.memory_rows import MemoryRows
from nathlon.arena.worlds.named_loader import named_loader
from nathlon.policies.bundled import generalist
from nathlon.policies.general.outputs import IllegalActionError
from nathlon.policies.sources.finding import find_sources
from nathlon.selection.config import Config, read_config
from nathlon.selection.nightly.watching import watch
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from tests.support.games import refused

LOADER = '''
import json
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from nathlon import ObservationSpec
from beside import PACE


class State(NamedTuple):
    steps: int
    kept: torch.Tensor


def gently(path, observation_space, action_space):
    """A function of one observation."""
    throttle = json.loads(path.read_text()) * PACE
    return lambda observation: np.array([throttle, 0.0])


class Module(torch.nn.Module):
    def __init__(self, throttle):
        super().__init__()
        self.throttle = throttle

    def forward(self, seen):
        self.shape = tuple(seen.shape)
        return torch.tensor([self.throttle, 0.0]).expand(len(seen), 2)


def module(path, observation_space, action_space):
    assert observation_space.shape == (ObservationSpec().size,)
    return Module(json.loads(path.read_text()) * PACE)


class Counting:
    """Full throttle in its third step alone; it sees four points of the course."""

    observation_spec = ObservationSpec(course_points=4)

    def act(self, observation, memory):
        assert observation.shape == (self.observation_spec.size,)
        before = State(0, torch.zeros(2)) if memory is None else memory
        after = State(before.steps + 1, before.kept + 0.1)
        return [float(after.steps == 3), float(after.kept[0])], after


def counting(path, observation_space, action_space):
    return Counting()


class Growing:
    def act(self, observation, memory):
        return [0.0, 0.0], np.zeros(1 if memory is None else len(memory) + 1)


def growing(path, observation_space, action_space):
    return Growing()


class Itself:
    def reset(self, seed):
        pass

    def __call__(self, observation):
        return [0.0, 0.0]


def itself(path, observation_space, action_space):
    return Itself()


def three(path, observation_space, action_space):
    return lambda observation: [0.0, 0.0, 0.0]


class Whole:
    """Does as nathlon's own policies do."""

    observation_spec = ObservationSpec(course_points=4)

    def initial_memory(self, n):
        return np.zeros((n, 0), np.float32)

    def act(self, observations, memory):
        return np.zeros((len(observations), 2), np.float32), memory


def whole(path, observation_space, action_space):
    return Whole()


class Unseen:
    initial_memory = Whole.initial_memory
    act = Whole.act


def unseen(path, observation_space, action_space):
    return Unseen()


class Whimsical(Whole):
    @property
    def observation_spec(self):
        if Path(__file__).with_name("mood").exists():
            raise ArithmeticError("not today")
        return ObservationSpec(course_points=4)


def whimsical(path, observation_space, action_space):
    return Whimsical()


no_function = 3
no_ending = {3: whole}
'''


def loader(folder: Path, pace: float = 1.0) -> Path:
    (folder / "beside.py").write_text(f"PACE = {pace}\n")
    path = folder / "mine.py"
    path.write_text(LOADER)
    find_world.cache_clear()
    return path


def world_with(folder: Path, load: str) -> World:
    return load_world(f"racing+{loader(folder)}:{load}", "lindenring", "gt3")


def weights(folder: Path, throttle: float = 0.3, name: str = "a.pt") -> str:
    path = folder / name
    path.write_text(json.dumps(throttle))
    return str(path)


def raced(world: World, source: str) -> Match:
    entrant = world.enter(source)
    taken = (Seat(0), Seat(0))
    where = ("race", "slipstream_pass", "slipstream_pass", "lindenring", "gt3")
    return Match(*where, (entrant.id,), (source,), (Race(1, taken),), entrant.world)


def test_a_function_and_a_module_drive_alike(tmp_path: Path) -> None:
    """The module is asked for both cars at once, the function for one after the other."""
    results = []
    for load in ("gently", "module"):
        world = world_with(tmp_path, load)
        match = raced(world, weights(tmp_path))
        policy: Any = world.policy(match.sources[0])
        rows = run_match(match, [policy])
        results.append(rows.drop("match"))
        assert set(rows["ending"]) == {"time_up"}, "two cars that hinder each other, at a gentle pace"
    assert results[0].equals(results[1])


def test_a_memory_is_that_of_a_car(tmp_path: Path) -> None:
    """A row that is kept, as of a car whose turn it is not, goes on from there."""
    policy: Any = world_with(tmp_path, "counting").policy(weights(tmp_path))
    assert policy.observation_spec == ObservationSpec(course_points=4)
    seen, first = policy.observation_spec.blank(2), policy.initial_memory(2)
    actions, second = policy.act(seen, first)
    assert np.allclose(actions, [[0.0, 0.1], [0.0, 0.1]])
    _, third = policy.act(seen, second)
    mixed = np.stack([third[0], second[1]])
    actions, _ = policy.act(seen, mixed)
    assert np.allclose(actions, [[1.0, 0.3], [0.0, 0.2]])


def test_one_that_does_as_ours_do_is_asked_as_ours_are(tmp_path: Path) -> None:
    policy: Any = world_with(tmp_path, "whole").policy(weights(tmp_path))
    assert type(policy).__name__ == "Whole"


@pytest.mark.parametrize(
    ("load", "said"),
    [
        ("growing", "expected [((1,), dtype('float64'))] as after the first step"),
        ("itself", "keeps its state itself"),
        ("unseen", "has initial_memory and no observation_spec"),
        ("three", "gives 3 numbers, expected 2 for the action space"),
    ],
)
def test_what_cannot_drive_is_refused_by_its_file(tmp_path: Path, load: str, said: str) -> None:
    source = weights(tmp_path)
    with refused(source, said):
        world_with(tmp_path, load).policy(source)


@pytest.mark.parametrize(
    ("load", "said"),
    [
        ("no_function", "no_function': load has '.pt': 3, expected an ending of files and a function"),
        ("no_ending", "no_ending': load has 3: "),
        ("missing", "mine.py has no 'missing'"),
    ],
)
def test_what_is_no_loader_is_refused(tmp_path: Path, load: str, said: str) -> None:
    with refused("loader '", said):
        world_with(tmp_path, load)


def test_a_loader_is_called_by_text() -> None:
    """A report that is written hours later could not name another."""
    with refused("world '", "expected a name in UTF-8"):
        load_world("racing+/tmp/\udcff.py:load", "lindenring", "gt3")


def test_a_loader_that_changes_while_matches_run_stops_them(tmp_path: Path) -> None:
    """Another process has given the match its key; this one has just loaded the file as it is now."""
    match = raced(world_with(tmp_path, "gently"), weights(tmp_path))
    assert match.key
    (tmp_path / "beside.py").write_text("PACE = 0.5\n")
    find_world.cache_clear()
    named_loader.cache_clear()
    [(_, answer)] = do([MatchJob(match)], Watch())
    assert isinstance(answer, InputError)
    assert "have changed since the run began" in str(answer)


def test_what_cannot_be_loaded_any_more_is_its_files_fault(tmp_path: Path) -> None:
    match = raced(world_with(tmp_path, "whimsical"), source := weights(tmp_path))
    (tmp_path / "mood").touch()
    [(_, answer)] = do([MatchJob(match)], Watch())
    assert str(answer) == f"{source}: cannot be opened (ArithmeticError), expected a policy"


def test_results_are_kept_under_the_loader_and_what_it_imports(tmp_path: Path) -> None:
    source = weights(tmp_path)
    world = world_with(tmp_path, "gently")
    match = raced(world, source)
    plain = Match(*("",) * 3, "lindenring", "gt3", ("driver",), ("driver",), ())
    told = world.facts("slipstream_pass")["loader"]
    assert set(told["files"]) == {"mine.py", "beside.py"}
    assert told["packages"]["torch"] == version("torch")
    assert "json" not in told["packages"]
    assert "loader" not in load_world(plain.world, "lindenring", "gt3").facts("slipstream_pass")
    before = match.key
    loader(tmp_path, pace=0.5)
    named_loader.cache_clear()
    again = raced(load_world(world.name, "lindenring", "gt3"), source)
    assert again.entrants == match.entrants
    assert again.key != before


def test_files_enter_and_folders_hold_them(tmp_path: Path) -> None:
    """What nathlon reads itself enters beside them."""
    world = world_with(tmp_path, "gently")
    folder = tmp_path / "runs"
    folder.mkdir()
    sources = [weights(folder, 0.3, "first.pt"), weights(folder, 0.4, "second.pt")]
    assert find_sources([folder], endings=world.loaders) == sources
    assert len(watch([str(folder)], world.loaders).digests) == 2
    entrants = [world.enter(source) for source in [*sources, str(generalist())]]
    assert [one.name for one in entrants[:2]] == ["first", "second"]
    assert {one.world for one in entrants} == {world.name}
    assert len({one.id for one in entrants}) == 3


def test_a_configuration_names_a_loader_from_its_folder(tmp_path: Path) -> None:
    path = tmp_path / "nathlon.toml"
    path.write_text('loader = "mine.py:gently"\n')
    loader(tmp_path)
    config = read_config(path)
    assert config.world == f"racing+{tmp_path / 'mine.py'}:gently"
    digest = config.digest
    (tmp_path / "beside.py").write_text("PACE = 0.1\n")
    named_loader.cache_clear()
    find_world.cache_clear()
    assert config.digest != digest
    assert read_config(path).world == configured(None, loader=f"{tmp_path / 'mine.py'}:gently").world
    path.write_text("loader = 3\n")
    with refused(f"{path}: field loader is 3: expected PATH.py:NAME or MODULE:NAME"):
        read_config(path)
    with refused("world 'tag.py:world': has no --loader, expected load=function in its mapping"):
        configured(Config(world="tag.py:world"), loader="mine.py:load")
    assert in_folder("racing", tmp_path) == "racing"
    assert in_folder("tag.py:world", tmp_path) == f"{tmp_path / 'tag.py'}:world"


def test_memories_come_back_to_the_bit() -> None:
    key = np.array([2**32 - 1, 1], np.uint32)
    memory = {"key": key, "hidden": (torch.tensor([[0.1]]), np.float64(0.1)), "steps": 2**53, "none": None}
    rows = MemoryRows(memory)
    back = rows.memory(rows.row(memory))
    assert back["key"].tolist() == key.tolist()
    assert torch.equal(back["hidden"][0], memory["hidden"][0])  # type: ignore[index]
    assert (float(back["hidden"][1]), back["steps"], back["none"]) == (0.1, 2**53, None)
    assert rows.memory(rows.blank(1)[0]) is None
    with pytest.raises(IllegalActionError, match="memory holds str"):
        MemoryRows("words")
