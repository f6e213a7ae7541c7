"""Loaders in another interpreter: policies play as by a loader here, and harm nobody but themselves."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest

from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.world_registry import load_world
from nathlon.arena.worlds.environment import PettingZooWorld
from nathlon.arena.worlds.far_loader import FarError, FarLoader
from tests.arena.test_loaded import LOADERS, names, scores
from tests.support.games import ENVIRONMENTS, refused

THERE = '''
import os
import random
import sys
import time
from pathlib import Path

PARENT = os.getppid()


def there(path, observation_space, action_space):
    assert "nathlon" not in sys.modules
    assert action_space.n == 3
    return Names(path)


def drawn(path, observation_space, action_space):
    """Right if its own generator draws what one of the episode's seed would."""
    own = []

    class Drawn:
        def reset(self, seed):
            self.rng = random.Random(seed)

        def __call__(self, observation):
            right = self.rng.random() == random.random()
            return int(observation.argmax()) if right else (int(observation.argmax()) + 1) % 3

    return Drawn()


def scored(path, observation_space, action_space):
    import torch

    module = torch.nn.Linear(3, 3)
    torch.nn.init.eye_(module.weight)
    torch.nn.init.zeros_(module.bias)
    return module


def greedy(path, observation_space, action_space):
    return bytearray(3 << 30)


def ends(path, observation_space, action_space):
    """Ends its process at the third step, or when it is loaded; others name all lights."""
    what = Path(path).read_text()
    if what == "load":
        os._exit(1)
    steps = []

    def act(observation):
        steps.append(1)
        if what == "step" and len(steps) == 3:
            os._exit(1)
        return int(observation.argmax())

    return act
'''


def far(folder: Path, load: str) -> PettingZooWorld:
    """A world in another process of this interpreter, with a loader of LOADERS or THERE."""
    (folder / "envs.py").write_text(ENVIRONMENTS)
    (folder / "loaders.py").write_text(f"from pathlib import Path\n{LOADERS}\n{THERE}")
    made = f"PettingZooWorld({{'duel': 'envs.py:duel'}}, python=sys.executable, load={load})"
    (folder / "worlds.py").write_text(f"import sys\nfrom nathlon import PettingZooWorld\nworld = {made}\n")
    world = load_world(f"{folder / 'worlds.py'}:world")
    assert isinstance(world, PettingZooWorld)
    return world


@pytest.fixture(scope="module")
def playing(tmp_path_factory: pytest.TempPathFactory) -> PettingZooWorld:
    """Endings for several loaders, which share what each costs to start."""
    loaders = ("there", "counts", "counts_itself", "drawn", "broken", "greedy", "nothing", "wrong", "scored")
    return far(tmp_path_factory.mktemp("far"), str({f".{one}": f"loaders.py:{one}" for one in loaders}))


@pytest.mark.parametrize("load", ["there", "scored"])
def test_it_plays_as_a_loader_here_does(playing: PettingZooWorld, tmp_path: Path, load: str) -> None:
    best, worst = (
        playing.policy(names(tmp_path, 3, f".{load}")),
        playing.policy(names(tmp_path, 0, ".there")),
    )
    assert scores(playing, [best, worst], (0, 1), seeds=2) == [3.0, -3.0] * 2


@pytest.mark.parametrize("load", ["counts", "counts_itself"])
def test_a_memory_is_kept_by_seat_and_episode(playing: PettingZooWorld, tmp_path: Path, load: str) -> None:
    """Right in every second step: two seats that shared a count would be right in all, or in none."""
    policy = playing.policy(names(tmp_path, 1, f".{load}"))
    best = playing.policy(names(tmp_path, 3, ".there"))
    assert scores(playing, [policy, best], (0, 1), seeds=2) == [-1.5, 1.5] * 2
    assert scores(playing, [policy], (0, 0), seeds=2) == [0.0] * 4


def test_each_has_random_generators_of_its_own(playing: PettingZooWorld, tmp_path: Path) -> None:
    policies = [playing.policy(names(tmp_path, 1, ending)) for ending in (".drawn", ".there")]
    assert scores(playing, [policies[0], policies[0]], (0, 1)) == [0.0, 0.0]
    worst = playing.policy(names(tmp_path, 0, ".there"))
    assert scores(playing, [policies[0], worst], (0, 1)) == [3.0, -3.0]


@pytest.mark.parametrize(
    ("load", "said"),
    [
        ("broken", "broken raised KeyError ('left'), expected a policy"),
        pytest.param(
            *("greedy", "greedy raised MemoryError (), expected a policy"),
            marks=pytest.mark.skipif(sys.platform != "linux", reason="Linux alone limits memory"),
        ),
        ("nothing", "nothing raised TypeError (gives NoneType, expected what is called with an observation"),
        ("wrong", "shown an observation, gives [3.5], expected whole numbers"),
    ],
)
def test_what_gives_no_policy_is_refused_by_its_file(
    playing: PettingZooWorld, tmp_path: Path, load: str, said: str
) -> None:
    source = names(tmp_path, 3, f".{load}")
    with refused(f"{source}: {said}"):
        playing.policy(source)


def test_a_loader_that_cannot_be_found_is_refused(tmp_path: Path) -> None:
    world = far(tmp_path, "'missing.py:load'")
    with refused(f"{tmp_path / 'missing.py'}: no such file, expected a loader"):
        world.facts("duel")
    with pytest.raises(ValueError, match=r"expected PATH\.py:FUNCTION"):
        PettingZooWorld({"duel": "envs.py:duel"}, python=sys.executable, load="loaders:there")


def test_the_loader_s_file_decides_episodes(tmp_path: Path) -> None:
    told = far(tmp_path, "{'.pt': 'loaders.py:there'}").facts("duel")["world_files"]["files"]
    assert set(told) == {"envs.py", "loaders.py", "worlds.py"}


def test_what_is_not_needed_any_more_is_given_up_there(playing: PettingZooWorld, tmp_path: Path) -> None:
    loader = playing.loaders[".there"]
    assert isinstance(loader, FarLoader)
    [observed, done] = playing.spaces("duel")[0]
    loader(Path(names(tmp_path, 3)), observed, done)
    policy = loader(Path(names(tmp_path, 3)), observed, done)
    with pytest.raises(FarError, match="raised KeyError"):
        loader.ask({"number": policy._number - 1, "seed": 1})
    policy.reset(1)


def test_who_ends_the_process_there_is_out_and_its_opponent_plays(tmp_path: Path) -> None:
    world = far(tmp_path, "'loaders.py:ends'")
    sources = []
    for what in ("step", "stay", "load"):
        sources.append(str(tmp_path / f"{what}.pt"))
        Path(sources[-1]).write_text(what)
    ids = tuple(world.enter(source).id for source in sources[:2])
    races = (Race(1, (Seat(0), Seat(1))),)
    match = Match("test", "duel", "duel", "", "", ids, tuple(sources[:2]), races, world.name)
    with Pool(1) as pool:
        [(_, rows)] = pool.run([match])
    assert rows["ending"].to_list() == ["policy_raised", "finished"]
    with refused(f"{sources[2]}: ends ended its process, expected a policy"):
        world.policy(sources[2])
    policy = world.policy(sources[1])
    loader = world.loaders[".pt"]
    assert isinstance(loader, FarLoader)
    os.kill(loader.running.process.pid, signal.SIGKILL)
    loader.running.process.wait()
    assert scores(world, [policy, policy], (0, 1)) == [0.0, 0.0], "it is loaded anew"
