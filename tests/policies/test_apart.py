"""Opponents that are code have processes of their own, in training and in environments too."""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import nathlon
from nathlon.policies.apart import PolicyApart, load_guest
from nathlon.policies.load import load_policy
from nathlon.sim.errors import InputError
from tests.policies.test_plugin import install
from tests.support.command_line import nathlon as command
from tests.support.command_line import refused
from tests.support.trainings import TOML

PLACE = ("lindenring", "gt3")

CODE = '''
import os
import time

import numpy as np
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.observation import ObservationSpec


class Counter:
    """Steers by what it remembers and sees."""

    observation_spec = ObservationSpec(course_points=1)

    def __init__(self, circuit, car):
        pass

    def initial_memory(self, n):
        return np.zeros((n, 1), np.float32)

    def act(self, observations, memory):
        self.misbehave(observations)
        steering = np.tanh(observations[:, :1]) * 0.01 + memory * 0.001
        return np.hstack([np.full_like(steering, 0.5), steering]), memory + 1

    def misbehave(self, observations):
        pass


class Sees(Counter):
    """Goes by the sum of what it sees in its picture, and by its first sensor."""

    observation_spec = ObservationSpec(camera=CameraSpec(width=16, height=16))

    def act(self, observations, memory):
        bright = observations["picture"].sum(axis=(1, 2, 3)) / 255.0 / 768.0
        return np.stack([bright, observations["sensors"][:, 0]], axis=1).astype(np.float32), memory + 1


class Hangs(Counter):
    """Not at first."""

    def act(self, observations, memory):
        time.sleep(1000.0 if memory.any() else 0.0)
        return super().act(observations, memory)


class Exits(Counter):
    def misbehave(self, observations):
        os._exit(3)


class Raises(Counter):
    def misbehave(self, observations):
        raise RuntimeError("out of fuel")


class Scribbles(Counter):
    def misbehave(self, observations):
        observations[...] = 0.0


class Prints(Counter):
    def misbehave(self, observations):
        os.write(1, b"noise")


class Narrow(Counter):
    def act(self, observations, memory):
        return np.zeros((len(observations), 1), np.float32), memory


class Infinite(Counter):
    def act(self, observations, memory):
        return np.full((len(observations), 2), np.inf, np.float32), memory


class Forgets(Counter):
    def act(self, observations, memory):
        return np.zeros((len(observations), 2), np.float32), memory[:1]


class Sleeps(Counter):
    def __init__(self, circuit, car):
        time.sleep(1000)
'''

NAMES = (
    "Counter",
    "Hangs",
    "Exits",
    "Raises",
    "Scribbles",
    "Prints",
    "Narrow",
    "Infinite",
    "Forgets",
    "Sleeps",
    "Sees",
)


@pytest.fixture(autouse=True)
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with an installed module and its entry points, on the path."""
    site = tmp_path / "site"
    site.mkdir()
    (site / "rivals.py").write_text(CODE)
    install(
        site,
        "rivals",
        "[nathlon.policies]\n" + "".join(f"{name.lower()} = rivals:{name}\n" for name in NAMES),
    )
    monkeypatch.syspath_prepend(site)
    monkeypatch.delitem(sys.modules, "rivals", raising=False)
    return site


def seen(policy: nathlon.Policy, n: int) -> np.ndarray:
    """Something to be seen by n cars."""
    return np.random.default_rng(1).normal(size=(n, policy.observation_spec.size)).astype(np.float32)


def test_it_sees_by_a_camera_as_it_would_in_this_process() -> None:
    apart, here = load_guest("plugin:sees", *PLACE), load_policy("plugin:sees", *PLACE)
    assert isinstance(apart, PolicyApart)
    apart.warm_up(1)
    looks = here.observation_spec.blank(2)
    looks["picture"][1], looks["sensors"][:, 0] = 255, [0.25, -0.5]
    actions, _ = apart.act(looks, apart.initial_memory(2))
    np.testing.assert_array_equal(actions, here.act(looks, here.initial_memory(2))[0])
    np.testing.assert_allclose(actions, [[0.0, 0.25], [1.0, -0.5]])


def test_it_drives_as_it_would_in_this_process() -> None:
    apart, here = load_guest("plugin:counter", *PLACE), load_policy("plugin:counter", *PLACE)
    assert isinstance(apart, PolicyApart)
    assert apart.observation_spec == here.observation_spec
    memories = apart.initial_memory(3), here.initial_memory(3)
    for _ in range(3):
        observations = seen(here, 3)
        actions, memory = apart.act(observations, memories[0])
        expected, expected_memory = here.act(observations, memories[1])
        memories = memory, expected_memory
        np.testing.assert_array_equal(actions, expected)
        np.testing.assert_array_equal(memory, expected_memory)


def test_only_what_may_do_harm_has_a_process() -> None:
    assert not isinstance(load_guest("driver:pace=0.9", *PLACE), PolicyApart)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("hangs", "plugin:hangs: has not answered in 1 s"),
        ("exits", "plugin:exits: ended its process"),
        ("raises", "plugin:raises: raised RuntimeError (out of fuel), expected actions"),
        ("narrow", "plugin:narrow: answers with (2, 1), expected (2, 2) finite numbers"),
        ("infinite", "plugin:infinite: answers with (2, 2), expected (2, 2) finite numbers"),
        ("forgets", "plugin:forgets: has memory of shape (1, 1), expected 2 rows"),
    ],
)
def test_who_does_not_answer_as_it_should_is_named(name: str, said: str) -> None:
    policy = PolicyApart(f"plugin:{name}", *PLACE, answer_s=1.0)

    def drive() -> None:
        memory = policy.initial_memory(2)
        for _ in range(2):
            _, memory = policy.act(seen(policy, 2), memory)

    with pytest.raises(InputError) as refusal:
        drive()
    assert str(refusal.value) == said


def test_opening_has_its_time() -> None:
    with pytest.raises(InputError, match="plugin:sleeps: has not answered in 5 s"):
        PolicyApart("plugin:sleeps", *PLACE, first_answer_s=5.0)


def test_what_cannot_be_opened_is_told_as_elsewhere() -> None:
    with pytest.raises(InputError, match="plugin:nobody: no package offers this policy"):
        load_guest("plugin:nobody", *PLACE)


def test_it_writes_into_memory_of_its_own() -> None:
    policy = load_guest("plugin:scribbles", *PLACE)
    observations = seen(policy, 2)
    before = observations.copy()
    policy.act(observations, policy.initial_memory(2))
    np.testing.assert_array_equal(observations, before)


def test_its_process_ends_with_it() -> None:
    policy = PolicyApart("plugin:counter", *PLACE)
    process = policy.process
    assert process.poll() is None
    del policy
    gc.collect()
    assert process.poll() is not None


def test_its_process_ends_with_ours(site: Path) -> None:
    """Also when ours is killed, and while it hangs."""
    program = (
        "import os; from nathlon.policies.apart import PolicyApart;"
        "policy = PolicyApart('plugin:counter', 'lindenring', 'gt3');"
        "print(policy.process.pid, flush=True); os.kill(os.getpid(), 9)"
    )
    killed = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": str(site)},
        stdout=subprocess.PIPE,
        check=False,
    )
    pid = int(killed.stdout)
    ended = subprocess.run(["timeout", "20", "tail", f"--pid={pid}", "-f", "/dev/null"], check=False)
    assert ended.returncode == 0


def test_an_environment_survives_its_opponent() -> None:
    env = gymnasium.make("nathlon/Race-v0", scenario="1v3", opponents=("plugin:exits",))
    env.reset(seed=1)
    with pytest.raises(InputError, match="plugin:exits: ended its process"):
        env.step(np.zeros(2, np.float32))


def test_training_says_whose_fault_it_is(tmp_path: Path) -> None:
    config = tmp_path / "run.toml"
    config.write_text(TOML.replace('opponents = ["driver"]', 'opponents = ["plugin:exits"]'))
    done = command("train", config, "--out", tmp_path / "run", "--json", cwd=tmp_path)
    refused(done, "nathlon: plugin:exits: ended its process")
    assert json.loads(done.stdout) == {"error": "plugin:exits: ended its process", "code": 2}


def test_what_it_prints_is_no_output_of_ours(site: Path) -> None:
    program = (
        "import numpy as np; from nathlon.policies.apart import PolicyApart;"
        "policy = PolicyApart('plugin:prints', 'lindenring', 'gt3');"
        "seen = np.zeros((1, policy.observation_spec.size), np.float32);"
        "policy.act(seen, policy.initial_memory(1))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout, done.stderr) == ("", "noise")
