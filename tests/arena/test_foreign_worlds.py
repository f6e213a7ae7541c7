"""Environments in another interpreter: the same rows, and no harm from those that hang, exit or print."""

from __future__ import annotations

import ast
import json
import os
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.results import RESULTS
from nathlon.arena.world_registry import load_world
from nathlon.arena.worlds.environment import PettingZooWorld
from nathlon.arena.worlds.foreign import HOST
from nathlon.policies.hosting import wire
from nathlon.policies.hosting.wire import pack, unpack
from tests.arena.test_worlds import play, policies_of
from tests.support.games import player, refused, world_of


def far(folder: Path, function: str, more: str = "", kind: str = "PettingZooWorld") -> str:
    """The name of a world whose scenario runs in another interpreter."""
    made = f"{kind}({{'duel': 'envs.py:{function}'}}, python=sys.executable, {more})"
    return world_of(folder, made, f"far_{function}.py")


def test_it_gives_the_same_rows_as_in_this_interpreter(tmp_path: Path) -> None:
    near = load_world(world_of(tmp_path, "PettingZooWorld({'duel': envs['leaves']})"))
    there = load_world(far(tmp_path, "leaves"))
    assert there.setup("duel") == near.setup("duel")
    rows = [
        play(world, [world.policy("random"), *policies_of(world, tmp_path, 2)], (0, 1), seeds=(1, 2, 3))
        for world in (near, there)
    ]
    drop = pl.exclude("match")
    assert rows[0].select(drop).equals(rows[1].select(drop))


def test_it_tells_what_decides(tmp_path: Path) -> None:
    told = load_world(far(tmp_path, "duel", "packages=('gymnasium',)")).facts("duel")["world_files"]
    assert set(told["files"]) == {"envs.py", "far_duel.py"}
    assert told["packages"]["numpy"] == np.__version__
    assert set(told["packages"]) == {"gymnasium", "numpy", "python"}
    json.dumps(told)


def test_a_file_may_import_what_lies_beside_it(tmp_path: Path) -> None:
    """Also later and in another interpreter; other modules of the process find none of it by mistake."""
    beside = tmp_path / "sub"
    beside.mkdir()
    (beside / "queue.py").write_text("")
    (beside / "salvage_of_test.py").write_text(
        "def pieces(): import salvage_later_of_test as one; return one.N"
    )
    (beside / "salvage_later_of_test.py").write_text("N = 'left', 'right'")
    lines = (
        "import runpy",
        "from salvage_of_test import pieces",
        f"envs = runpy.run_path({str(tmp_path / 'envs.py')!r})",
        "def duel(): return envs['Game'](*pieces())",
    )
    (beside / "scenario.py").write_text("\n".join(lines))
    made = "PettingZooWorld({'duel': 'sub/scenario.py:duel'}, python=sys.executable)"
    there = load_world(world_of(tmp_path, made))
    (beside / "worlds.py").write_text(
        "\n".join(lines) + "\nfrom nathlon import PettingZooWorld\nworld = PettingZooWorld({'duel': duel})\n"
    )
    here = load_world(f"{beside / 'worlds.py'}:world")
    for world, own in ((there, "scenario.py"), (here, "worlds.py")):
        assert world.setup("duel").seats == ("left", "right")
        files = world.facts("duel")["world_files"]["files"]
        assert {own, "salvage_of_test.py", "salvage_later_of_test.py"} <= set(files)
    sys.modules.pop("queue", None)
    found = find_spec("queue")
    assert found is not None
    assert beside not in Path(str(found.origin)).parents


@pytest.mark.parametrize("function", ["Alone", "Old"])
def test_the_api_of_old_plays_like_that_of_now(tmp_path: Path, function: str) -> None:
    measures = "measures={'steps': Declared('steps')}"
    world = load_world(far(tmp_path, function, measures, "GymnasiumWorld"))
    rows = play(world, policies_of(world, tmp_path, 3), (0,))
    assert rows["score"].to_list() == [6.0]
    assert rows["ending"].to_list() == ["time_up"]
    assert rows["measures"].to_list() == ['{"steps": 6.0}']


@pytest.mark.parametrize(
    ("function", "said"),
    [
        ("hangs", "step 3: has not answered in 1 s"),
        ("prints", "step 3: has not answered in 1 s"),
        ("exits", "step 3: ended its process"),
        ("garbage", "step 3: answers with no message"),
    ],
)
def test_one_that_fails_voids_its_episode_and_the_next_one_plays(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, function: str, said: str
) -> None:
    name = far(tmp_path, function, "answer_s=1.0")
    world = load_world(name)
    assert isinstance(world, PettingZooWorld)
    policies = policies_of(world, tmp_path, 3, 0)
    # Its process plays one episode well before it fails, and so does the one after it.
    before = world.made("duel")
    before.close()
    failing = world._environments["duel"]
    rows = play(world, policies, (0, 1))
    assert set(rows["ending"]) == {"simulator_fault"}
    assert f"world {name!r}, scenario 'duel': {said}" in caplog.text
    assert world.setup("duel").seats == ("left", "right"), "it is still known"
    assert world._environments.get("duel") is not failing, "its process is gone"


def test_the_pool_goes_on_after_a_world_that_exits(tmp_path: Path, pool: Pool) -> None:
    name = far(tmp_path, "exits")
    source = player(tmp_path / "good.onnx", 3)
    world = load_world(name)
    identity = world.enter(source).id
    match = Match(
        "test", "duel", "duel", "", "", (identity,), (source,), (Race(1, (Seat(0), Seat(0))),), name
    )
    [(_, rows)] = pool.run([match])
    assert rows.schema == RESULTS
    assert set(rows["ending"]) == {"simulator_fault"}


def test_what_it_prints_is_no_output_of_ours(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "loud.py").write_text("import envs\nprint('hear me')\nduel = envs.duel\n")
    world = load_world(world_of(tmp_path, "PettingZooWorld({'duel': 'loud:duel'}, python=sys.executable)"))
    assert world.setup("duel").seats == ("left", "right")
    assert "hear me" not in capfd.readouterr().out


@pytest.mark.parametrize(
    ("made", "said"),
    [
        ("'envs.py:nested'", "seat 'left': the observation space is a Dict, expected Box"),
        ("'envs.py:nobody'", "AttributeError"),
        ("'not_there:duel'", "raised ModuleNotFoundError (No module named 'not_there')"),
        ("envs['duel']", "expected MODULE:FUNCTION or PATH.py:FUNCTION"),
    ],
)
def test_what_cannot_be_made_is_refused_with_a_sentence(tmp_path: Path, made: str, said: str) -> None:
    name = world_of(tmp_path, f"PettingZooWorld({{'duel': {made}}}, python=sys.executable)")
    with refused(said):
        load_world(name).setup("duel")


def test_an_interpreter_that_is_missing_is_refused(tmp_path: Path) -> None:
    name = world_of(tmp_path, "PettingZooWorld({'duel': 'envs.py:duel'}, python='/no/python')")
    with refused("/no/python: No such file or directory, expected an interpreter of Python"):
        load_world(name).setup("duel")


def test_its_process_ends_with_the_environment(tmp_path: Path) -> None:
    world = load_world(far(tmp_path, "duel"))
    assert isinstance(world, PettingZooWorld)
    environment = world.made("duel")
    process = environment._child.process
    assert os.getpgid(process.pid) == process.pid, "so that its own processes end with it"
    del environment
    assert process.poll() is not None


def test_scalars_stay_scalars_between_processes() -> None:
    _, arrays = unpack(pack({}, {"one": np.asarray(3), "none": np.zeros((0, 2), np.float32)}))
    assert arrays["one"].shape == ()
    assert arrays["none"].shape == (0, 2)


@pytest.mark.parametrize("file", [HOST, HOST.with_name("policies_host.py"), Path(wire.__file__)])
def test_what_runs_there_needs_numpy_alone_and_an_old_python(file: Path) -> None:
    tree = ast.parse(file.read_text(), feature_version=(3, 7))
    wanted = {
        name.partition(".")[0]
        for node in tree.body
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in (
            [node.module or ""] if isinstance(node, ast.ImportFrom) else [n.name for n in node.names]
        )
    }
    assert wanted - set(sys.stdlib_module_names) == {"numpy"}
