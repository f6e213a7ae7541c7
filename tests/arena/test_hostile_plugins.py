"""Policies that are code and mean ill: what they do falls on them and on nobody else."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from onnx import TensorProto, helper

from nathlon.arena.entrance import enter_each
from nathlon.arena.entrant import enter
from nathlon.arena.job import Opening
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.output_log import DROPPED, LOG_BYTES
from nathlon.arena.pool import Pool
from nathlon.arena.results import POLICY_FAULTS, VOID_ENDINGS
from nathlon.arena.runner import run_match
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from tests.policies.test_plugin import install
from tests.support.checkpoints import BUNDLED

CODE = '''
import os
import random
import sys
import time

import numpy as np
from nathlon.sim.observation import ObservationSpec


class Straight:
    """Full throttle."""

    observation_spec = ObservationSpec(course_points=1)
    drawn = []

    def __init__(self, circuit, car):
        pass

    def initial_memory(self, n):
        return np.zeros((n, 1), np.float32)

    def act(self, observations, memory):
        self.misbehave(observations, memory)
        return np.tile(np.array([[1.0, 0.0]], np.float32), (len(observations), 1)), memory

    def misbehave(self, observations, memory):
        pass


class Scribbler(Straight):
    def misbehave(self, observations, memory):
        array = observations
        while array is not None:
            if isinstance(array, np.ndarray):
                array[...] = 1e9
            array = getattr(array, "base", None)
        memory[...] = np.nan_to_num(memory)


class Drawer(Straight):
    """Steers by chance, without a generator of its own."""

    def act(self, observations, memory):
        drawn = [[random.random(), np.random.random()] for _ in observations]
        return np.array(drawn, np.float32), memory


class Seeder(Straight):
    """Makes others' luck its own, and numpy raise."""

    def misbehave(self, observations, memory):
        random.seed(7)
        np.random.seed(7)
        np.seterr(all="raise")


class Divider(Straight):
    """Divides by zero, as one may."""

    def misbehave(self, observations, memory):
        np.zeros(1) / np.zeros(1)


class Slow(Straight):
    def misbehave(self, observations, memory):
        time.sleep(0.05)


class Talker(Straight):
    def misbehave(self, observations, memory):
        print("hello", flush=True)
        os.write(1, b"there\\n")
        print("stderr", file=sys.stderr, flush=True)


class Flood(Straight):
    def misbehave(self, observations, memory):
        os.write(1, b"x" * 100_000)


class Closer(Straight):
    """Leaves its process nothing to answer through."""

    def misbehave(self, observations, memory):
        os.closerange(0, 256)


class Silencer(Straight):
    """Whatever is said after this raises."""

    def misbehave(self, observations, memory):
        sys.stderr.close()
        sys.stdout = object()
        memory[...] = np.nan
        return memory


class Deaf(Straight):
    """Cannot even be made."""

    def __init__(self, circuit, car):
        os.closerange(3, 256)


class Hog(Straight):
    taken = []

    def misbehave(self, observations, memory):
        self.taken.append(np.ones(1 << 25))


class Loader(Straight):
    """Needs some memory, like a large network."""

    def __init__(self, circuit, car):
        self.weights = np.ones(1 << 26)


class Hanging(Straight):
    def __init__(self, circuit, car):
        time.sleep(3600)


class Exiting(Straight):
    def __init__(self, circuit, car):
        os._exit(3)
'''
NAMES = (
    "Straight", "Scribbler", "Drawer", "Seeder", "Divider", "Slow", "Talker", "Flood", "Hog", "Loader",
    "Hanging", "Exiting", "Closer", "Silencer", "Deaf",
)  # fmt: skip
PLACE = ("lindenring", "gt3")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with all of them, installed for this process and those that it starts."""
    site = tmp_path / "site"
    site.mkdir()
    (site / "hostile.py").write_text(CODE)
    install(site, "hostile", "[nathlon.policies]\n" + "".join(f"{name} = hostile:{name}\n" for name in NAMES))
    monkeypatch.syspath_prepend(site)
    monkeypatch.delitem(sys.modules, "hostile", raising=False)
    return site


def race(*names: str, seed: int = 1) -> Match:
    """One race of two cars, of plugins and drivers."""
    sources = [name if name.startswith("driver") else f"plugin:{name}" for name in names]
    ids = tuple(enter(source, *PLACE).id for source in sources)
    seats = tuple(Seat(k % len(sources)) for k in range(2))
    name = "slipstream_pass"
    return Match("race", name, name, *PLACE, ids, tuple(sources), (Race(seed, seats),))


def driven(pool: Pool, *matches: Match) -> list[pl.DataFrame]:
    results = dict(pool.run(matches))
    return [results[match] for match in matches]


def endings(results: pl.DataFrame) -> list[str]:
    return results.sort("car")["ending"].to_list()


def test_what_a_policy_writes_into_what_it_is_given_reaches_nobody(site: Path, pool: Pool) -> None:
    """All see by the same spec, and thus share what the world looked at, and both matches share the world."""
    calm, scribbled = (race(name, "Straight") for name in ("Straight", "Scribbler"))
    other = race("Straight", "driver", seed=2)
    [alone] = driven(pool, other)
    [expected] = driven(pool, calm)
    together, beside = driven(pool, scribbled, other)
    assert beside.equals(alone)
    plain = together.drop("match", "entrant")
    assert plain.equals(expected.drop("match", "entrant"))


def test_what_one_policy_seeds_is_not_what_another_draws(site: Path, pool: Pool) -> None:
    drawing, seeding = race("Drawer", "driver"), race("Seeder", "driver")
    [first] = driven(pool, drawing)
    _, after = driven(pool, seeding, drawing)
    assert after.equals(first), "what is drawn repeats, whoever has seeded meanwhile"
    assert not driven(pool, race("Drawer", "driver", seed=2))[0].drop("match").equals(first.drop("match"))
    *_, divided = driven(pool, race("Seeder", "Straight"), race("Divider", "driver"))
    assert "policy_raised" not in endings(divided)


def test_the_generators_of_whoever_runs_a_match_stay_as_they_were(site: Path) -> None:
    random.seed(3)
    np.random.seed(3)  # noqa: NPY002 - the one that policies share
    expected = random.random(), np.random.random()  # noqa: NPY002
    random.seed(3)
    np.random.seed(3)  # noqa: NPY002
    handling = np.geterr()
    match = race("Seeder", "Drawer")
    run_match(match, match_policies(match))
    assert (random.random(), np.random.random()) == expected  # noqa: NPY002
    assert np.geterr() == handling


def test_a_slow_policy_is_out_when_its_time_for_a_match_is_used_up(site: Path) -> None:
    with Pool(1, match_s=0.5) as pool:
        slow, other = driven(pool, race("Slow", "driver"), race("Straight", "driver"))
    assert endings(slow)[0] == "timed_out"
    assert slow.sort("car")["driven_s"][0] == pytest.approx(1.1, abs=0.3)
    assert "timed_out" not in endings(other)


@pytest.mark.parametrize("name", ["Closer", "Silencer"])
def test_what_a_policy_closes_is_its_own_fault(
    site: Path, caplog: pytest.LogCaptureFixture, name: str
) -> None:
    """Not the machine's: its matches would be void, and run again."""
    with Pool(1) as pool:
        [closed] = driven(pool, race(name, "Talker"))
    own, other = endings(closed)
    assert own == "policy_raised"
    assert other not in (*POLICY_FAULTS, *VOID_ENDINGS)
    assert (
        f"plugin:{name}: policy_raised, it has closed what its process answers or prints through"
        in caplog.text
    )


def test_what_policies_print_goes_to_a_bounded_log(
    site: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "policies.log"
    path.write_text("of an earlier run\n")
    with Pool(1) as pool:
        pool.log.keep_in(path)
        driven(pool, race("Talker", "driver"))
    lines = set(path.read_text().splitlines())
    assert {"of an earlier run", "hello", "there", "stderr"} <= lines
    with Pool(1) as pool:
        pool.log.keep_in(path)
        driven(pool, race("Flood", "driver"))
    assert path.stat().st_size == LOG_BYTES + len(DROPPED)
    assert path.read_bytes().endswith(DROPPED)
    assert capfd.readouterr() == ("", "")


def test_a_policy_that_cannot_be_made_is_refused_and_the_others_are_entered(site: Path) -> None:
    sources = [f"plugin:{name}" for name in ("Hanging", "Straight", "Exiting", "Seeder", "Deaf")]
    with Pool(1, first_answer_s=2.0) as pool:
        hanging, straight, exiting, seeder, deaf = enter_each(pool, sources, *PLACE)
    assert str(hanging) == "plugin:Hanging: took more than 2 s to open, expected a policy"
    assert str(exiting) == "plugin:Exiting: ended the process that opened it, expected a policy"
    assert (
        str(deaf) == "plugin:Deaf: has closed what its process answers or prints through, expected a policy"
    )
    assert [getattr(each, "name", None) for each in (straight, seeder)] == ["Straight", "Seeder"]


def test_nathlon_race_prints_json_whatever_policies_print(site: Path) -> None:
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(site), str(Path(__file__).parent.parent.parent)])
    }
    command = [sys.executable, "-m", "nathlon.cli", "race", "plugin:Talker", "driver", "--json"]
    ended = subprocess.run(
        [*command, "--scenario", "slipstream_pass"],
        capture_output=True,
        text=True,
        env=environment,
        check=True,
    )
    rows = json.loads(ended.stdout)
    assert {row["name"] for row in rows} == {"Talker", "driver"}
    assert "there" in ended.stderr.splitlines()


LIMITED = """
import json, resource, sys
from nathlon.arena.pool import Pool

if __name__ == "__main__":  # the rest is not for workers, which load what stands before it
    from tests.arena.test_hostile_plugins import race

    resource.setrlimit(resource.RLIMIT_DATA, (5 << 29, 5 << 29))
    pairs = [("Hog", "driver"), ("Loader", "driver"), ("Hog", "Loader"), ("Straight", "driver")]
    matches = [race(*pair) for pair in pairs]
    with Pool(1) as pool:
        results = dict(pool.run(matches))
    print(json.dumps([results[match].sort("car")["ending"].to_list() for match in matches]))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="Linux alone enforces a limit on memory")
def test_memory_that_one_policy_takes_is_no_fault_of_another(site: Path, tmp_path: Path) -> None:
    script = tmp_path / "limited.py"
    script.write_text(LIMITED)
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(site), str(Path(__file__).parent.parent.parent)])
    }
    printed = subprocess.check_output([sys.executable, script], env=environment)
    hog, loader, both, straight = json.loads(printed)
    assert (hog[0], both[0]) == ("policy_raised", "policy_raised")
    for others in (hog[1:], loader, both[1:], straight):
        assert "policy_raised" not in others


def greedy(size: int) -> int:
    return len(bytes(size))


@pytest.mark.skipif(sys.platform != "linux", reason="Linux alone enforces a limit on memory")
def test_opening_has_a_limit_on_memory_that_ends_with_it() -> None:
    """In a process of its own, which has no freed memory at hand."""
    assert subprocess.check_output([sys.executable, "-c", OPENING], text=True).split() == [
        "refused",
        "granted",
    ]


OPENING = """
from nathlon.policies.memory_limit import memory_limit

try:
    with memory_limit(1 << 26):
        bytes(1 << 28)
except MemoryError:
    print("refused")
print("granted" if len(bytes(1 << 28)) == 1 << 28 else "wrong")
"""


def raises(error: Exception) -> Iterator[None]:
    raise error


def test_whatever_opening_brings_about_is_a_sentence(pool: Pool) -> None:
    openings = [
        Opening("odd.zip", raises, (error,)) for error in (ValueError("?"), MemoryError(), TypeError())
    ]
    answers = pool.open([*openings, Opening("good", greedy, (3,))])
    assert [str(answer) for answer in answers[:3] if isinstance(answer, InputError)] == [
        "odd.zip: cannot be opened (ValueError), expected a policy",
        "odd.zip: needs more memory than there is, expected a policy",
        "odd.zip: cannot be opened (TypeError), expected a policy",
    ]
    assert answers[3] == 3


@pytest.mark.skipif(sys.platform != "linux", reason="Linux alone enforces a limit on memory")
def test_a_file_that_needs_too_much_memory_is_told_from_one_whose_memory_another_took(
    tmp_path: Path, pool: Pool
) -> None:
    """Of 64 bytes a constant of 4 GiB is made."""
    [small, good] = (tmp_path / name for name in ("small.onnx", "good.safetensors"))
    small.write_bytes(filling(1 << 30))
    shutil.copy(BUNDLED[0], good)
    refused, entered = enter_each(pool, [str(small), str(good)], *PLACE)
    assert str(refused).startswith(f"{small}: needs more memory than opening a policy may take")
    assert not isinstance(entered, InputError)


def filling(count: int) -> bytes:
    """A graph that fills so many numbers and then acts by their sum."""
    size = ObservationSpec().size
    graph = helper.make_graph(
        [
            helper.make_node("ConstantOfShape", ["shape"], ["many"]),
            helper.make_node("ReduceSum", ["many"], ["one"], keepdims=0),
            helper.make_node("Slice", ["seen", "from", "to", "axis"], ["first"]),
            helper.make_node("Add", ["first", "one"], ["action"]),
        ],
        "filling",
        [helper.make_tensor_value_info("seen", TensorProto.FLOAT, ["n", size])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["n", 2])],
        [
            helper.make_tensor("shape", TensorProto.INT64, [1], [count]),
            helper.make_tensor("from", TensorProto.INT64, [1], [0]),
            helper.make_tensor("to", TensorProto.INT64, [1], [2]),
            helper.make_tensor("axis", TensorProto.INT64, [1], [1]),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return bytes(model.SerializeToString())
