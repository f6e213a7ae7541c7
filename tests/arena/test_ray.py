"""Matches on the nodes of a Ray cluster: the results of one machine, whatever becomes of the nodes."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl
import pytest

import nathlon
from nathlon.arena.engine import Ended, Records
from nathlon.arena.entrant import enter
from nathlon.arena.job import Wanted
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.on_ray.cluster import joined, refusal
from nathlon.arena.on_ray.engine import RayEngine
from nathlon.arena.on_ray.nodes import Nodes
from nathlon.arena.pool import Pool
from nathlon.arena.processor import processor
from nathlon.arena.store import Store
from nathlon.arena.world_registry import load_world
from nathlon.policies.load import load_policy
from nathlon.policies.sources.handed_over import hand_over
from nathlon.results.summary import Summary
from nathlon.selection.config import read_config
from nathlon.selection.trials import against
from nathlon.sim.decisive import PACKAGE
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED
from tests.support.games import player, refused, world_of

if TYPE_CHECKING:
    from ray.cluster_utils import Cluster

pytestmark = pytest.mark.takes_long
pytest_plugins = ["tests.support.databases"]

DUEL = 'PettingZooWorld({"duel": envs["duel"]})'
HELD = """PettingZooWorld({"duel": envs["duel"]}, score=lambda seat: (held(), seat.total)[1])
import time
def held():
    folder = Path(__file__).parent
    while (folder / "held").exists() and len(list(folder.glob("scored-*"))) >= 40:
        time.sleep(0.02)
    (folder / f"scored-{time.monotonic_ns()}").touch()"""
"""Where it says so, some ten matches of two episodes with two seats come to their end, and no other."""
KILLED = """PettingZooWorld({"duel": envs["duel"]}, score=lambda seat: (killed_once(), seat.total)[1])
import os, signal
def killed_once():
    mark = Path(__file__).with_name("killed")
    if mark.with_name("deadly").exists() and not mark.exists():
        mark.touch()
        print("farewell", flush=True)
        os.kill(os.getpid(), signal.SIGKILL)"""
"""Where it says so, the first process that plays an episode is killed."""


_addresses = count(2)


def test_versions_that_differ_are_said_of_both() -> None:
    said = """Version mismatch: The cluster was started with:
    Ray: 2.55.1
    Python: 3.12.4
This process on node 10.0.0.7 was started with:
    Ray: 2.60.0
    Python: 3.11.9
"""
    assert refusal(said, "2.60.0") == (
        "the cluster has Ray 2.55.1 and Python 3.12.4, this machine Ray 2.60.0 and Python 3.11.9; "
        "expected the same versions on all machines"
    )
    nobody = refusal("Nobody is there. Please start one.", "2.60.0")
    assert nobody.startswith("Nobody is there; expected")
    assert "RAY_AUTH_MODE" in nobody


def node_of(cluster: Cluster, **more: Any) -> Any:
    """A new node with one processor.

    It has an address of its own: a program is bound to a node of its address, which is to stay.
    """
    address = f"127.0.0.{next(_addresses)}"
    return cluster.add_node(num_cpus=1, object_store_memory=100 << 20, node_ip_address=address, **more)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """A head without processors and two nodes with one each."""
    from ray.cluster_utils import Cluster

    with pytest.MonkeyPatch.context() as patch:
        # What is compiled already.
        patch.setenv("XDG_CACHE_HOME", os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache"))
        # Ray has its processes give way to all others, and beside other tests they would hardly begin.
        patch.setenv("RAY_worker_niceness", "0")
        head = {"num_cpus": 0, "include_dashboard": False, "object_store_memory": 100 << 20}
        cluster = Cluster(initialize_head=True, head_node_args=head)
        try:
            node_of(cluster)
            node_of(cluster)
            yield cluster
        finally:
            cluster.shutdown()


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Pool(1) as pool:
        yield pool


@pytest.fixture(scope="module")
def nodes(cluster: Cluster, pool: Pool) -> Iterator[Nodes]:
    with joined(cluster.address), Nodes(pool.log) as nodes:
        yield nodes


def duels(world: str, folder: Path, count: int = 3) -> list[Match]:
    """Matches of two seeds each between a good and a bad player, whose files are in the folder."""
    sources = tuple(player(folder / f"{right}.onnx", right) for right in (3, 1))
    entrants = tuple(load_world(world).enter(source).id for source in sources)
    seats = (Seat(0, 0), Seat(1, 1))
    return [
        Match(
            "pareto", f"duel-{number}", "duel", "", "", entrants, sources,
            (Race(2 * number, seats), Race(2 * number + 1, seats)), world,
        )
        for number in range(count)
    ]  # fmt: skip


def results_of(matches: list[Match], pool: Pool) -> pl.DataFrame:
    """RESULTS of matches as a pool gives them without a store."""
    found = {match.key: frame for match, frame in pool.run(matches)}
    return pl.concat([found[match.key] for match in matches])


@contextmanager
def under_way(engine: RayEngine, matches: list[Match], store: Store) -> Iterator[Future[list[Ended]]]:
    """While an engine has matches run, of which some are stored already."""
    with ThreadPoolExecutor(1) as threads:
        ended = threads.submit(lambda: list(engine.run(matches)))
        wait_until(lambda: ended.done() or bool(store.stored(match.key for match in matches)))
        yield ended


def wait_until(done: Callable[[], bool]) -> None:
    until = time.monotonic() + 60
    while not done():
        assert time.monotonic() < until
        time.sleep(0.02)


def test_nodes_have_the_results_of_this_machine(
    target: str, tmp_path: Path, nodes: Nodes, pool: Pool
) -> None:
    matches = duels(world_of(tmp_path, DUEL), tmp_path, 8)
    with Store(target) as store:
        ended = list(RayEngine(store, pool, nodes).run(matches))
        assert sorted(key for key, _ in ended) == sorted(match.key for match in matches)
        assert all(here for _, here in ended)
        assert store.results_of(match.key for match in matches).equals(results_of(matches, pool))
        assert set(store.processors(match.key for match in matches).values()) == {processor()}
        assert store.owners() == []
        assert store.verify() == []


def test_races_of_ours_and_their_recordings_are_those_of_this_machine(
    tmp_path: Path, nodes: Nodes, pool: Pool
) -> None:
    checkpoint = str(next(path for path in BUNDLED if path.stem.startswith("lindenring")))
    entrant = enter(checkpoint, "lindenring", "gt3")
    match = against("battery", "duel", "slipstream_pass", entrant, ["driver:pace=0.9"], [1], range(1))
    # An object stays here, and has the id of its file.
    hand_over(load_policy(checkpoint, "lindenring", "gt3"), "at home")
    other = against("battery", "duel", "slipstream_pass", entrant, ["driver:pace=0.9"], [1], range(1, 2))
    here = replace(other, sources=("object:at home", other.sources[1]))
    folders = tmp_path / "ray", tmp_path / "here"
    with Store(tmp_path / "store.sqlite") as store:
        engine = RayEngine(store, pool, nodes)
        assert {key for key, _ in engine.run([match, here])} == {match.key, here.key}
        results = store.results_of([match.key, here.key])
        assert results.equals(results_of([match, other], pool))
        recorders: tuple[Records, ...] = engine, pool
        for recorder, folder in zip(recorders, folders, strict=True):
            folder.mkdir()
            wanted = Wanted(match, (0,), (entrant.name, "driver"), store.results_of([match.key]), folder)
            [(recorded, answer)] = recorder.record([wanted])
            assert recorded.key == match.key
            assert not isinstance(answer, InputError)
            assert answer.logs == []
    [[one], [two]] = (list(folder.iterdir()) for folder in folders)
    assert one.name == two.name
    assert one.read_bytes() == two.read_bytes()


def test_nodes_join_and_leave_in_mid_run(
    cluster: Cluster,
    tmp_path: Path,
    nodes: Nodes,
    pool: Pool,
    caplog: pytest.LogCaptureFixture,
    capfd: pytest.CaptureFixture[str],
) -> None:
    matches = duels(world_of(tmp_path, HELD), tmp_path, 20)
    (tmp_path / "held").touch()
    with Store(tmp_path / "store.sqlite") as store:
        with under_way(RayEngine(store, pool, nodes), matches, store) as ended:
            before = cluster.worker_nodes.copy()
            node_of(cluster)
            for node in before:
                cluster.remove_node(node)
            assert len(store.stored(match.key for match in matches)) < 20
            (tmp_path / "held").unlink()
            assert sorted(key for key, _ in ended.result(60)) == sorted(match.key for match in matches)
        assert nodes.workers == 1
        assert store.results_of(match.key for match in matches).equals(results_of(matches, pool))
        assert store.owners() == []
        assert store.verify() == []
    assert "has left; others run its" in caplog.text
    # Ray's own threads in this process have nothing to say to whoever reads the terminal.
    assert re.findall(r"^\[\d{4}-.*", capfd.readouterr().err, re.MULTILINE) == []


def test_a_process_of_a_node_that_is_killed_loses_nothing(tmp_path: Path, nodes: Nodes, pool: Pool) -> None:
    matches = duels(world_of(tmp_path, KILLED), tmp_path, 8)
    (tmp_path / "deadly").touch()
    with Store(tmp_path / "store.sqlite") as store:
        assert len(list(RayEngine(store, pool, nodes).run(matches))) == 8
        assert (tmp_path / "killed").exists()
        assert pool.log.text.count("farewell") == 1
        assert store.results_of(match.key for match in matches).equals(results_of(matches, pool))


def test_a_checkpoint_that_has_changed_is_refused_when_all_others_have_run(
    tmp_path: Path, nodes: Nodes, pool: Pool
) -> None:
    matches = duels(world_of(tmp_path, DUEL), tmp_path)
    (tmp_path / "other").mkdir()
    [changed, *_] = duels(matches[0].world, tmp_path / "other")
    changed = replace(changed, races=(Race(99, changed.races[0].seats),))
    Path(changed.sources[0]).write_bytes(b"other")
    # Nodes have a file of these contents from before, so it is told apart from all.
    changed = replace(changed, entrants=("0" * 64, changed.entrants[1]))
    with Store(tmp_path / "store.sqlite") as store:
        with refused("checkpoint 000000000000 is missing"):
            list(RayEngine(store, pool, nodes).run([changed, *matches]))
        assert store.stored(match.key for match in matches) == {match.key for match in matches}
        assert store.owners() == []


CONFIGURED = """engine = "ray"
engine_address = "{}"
[pareto]
races = 2
most_races = 2
keep_probability = 0.0
[battery]
runs = 4
[tournament]
pairs = 6
block = 3
"""


def test_a_selection_comes_to_the_same_on_a_cluster(cluster: Cluster, tmp_path: Path) -> None:
    world = world_of(tmp_path, DUEL)
    players = [player(tmp_path / f"{right}.onnx", right) for right in (0, 2, 3)]
    config = tmp_path / "nathlon.toml"
    config.write_text(CONFIGURED.format(cluster.address))
    command = [sys.executable, "-m", "nathlon.cli", "evaluate", *players, "--config", str(config)]
    command += ["--world", world, "--workers", "1", "--out", str(tmp_path / "ray")]
    # Actors of this process keep the processors of the others.
    node_of(cluster)
    # In a process of its own: all that anything prints there is seen.
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    # Of what Ray says nothing gets here.
    told = [line.split()[0] for line in done.stderr.splitlines()]
    assert told == ["Filter", "N-athlon", "Round", "Timing"], done.stderr
    here = nathlon.select(
        players,
        tmp_path / "here",
        config=read_config(config).model_copy(update={"engine": "local"}),
        world=world,
        workers=1,
        progress=False,
    )
    there = Summary.model_validate_json((tmp_path / "ray" / "summary.json").read_text())
    assert there.ranking == here.summary.ranking
    with Store.open(tmp_path / "ray" / "store.sqlite") as one, Store.open(here.store) as two:
        assert [record.name for record in one.runs()] == [record.name for record in two.runs()]
        name = one.runs()[0].name
        assert one.results_of_run(name).equals(two.results_of_run(name))


def test_a_node_with_another_version_takes_nothing(cluster: Cluster, tmp_path: Path, pool: Pool) -> None:
    other = tmp_path / "other"
    shutil.copytree(PACKAGE, other / "nathlon", ignore=shutil.ignore_patterns("__pycache__"))
    with (other / "nathlon" / "arena" / "worlds" / "episodes.py").open("a") as module:
        module.write("# another version\n")
    # Before Ray puts the folders of this process first.
    (other / "sitecustomize.py").write_text("import nathlon")
    matches = duels(world_of(tmp_path, DUEL), tmp_path)
    for node in cluster.worker_nodes.copy():
        cluster.remove_node(node)
    node_of(cluster, env_vars={"PYTHONPATH": str(other)})
    with Store(tmp_path / "store.sqlite") as store, joined(cluster.address), Nodes(pool.log) as nodes:
        with refused("engine 'ray': node", "has another state of 'code'", "expected the nathlon"):
            list(RayEngine(store, pool, nodes).run(matches))
        assert store.stored(match.key for match in matches) == set()
        assert store.owners() == []
