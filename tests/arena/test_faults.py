"""Policies that misbehave in every way have a defined ending, and the others race on."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from nathlon.arena.classification import BLANK, classify, void
from nathlon.arena.entrant import enter
from nathlon.arena.job import Wanted
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.pool import Pool
from nathlon.arena.results import RESULTS
from nathlon.arena.runner import run_match
from nathlon.arena.team import Absent
from nathlon.policies.driver import Driver
from nathlon.policies.policy import Policy
from nathlon.sim.errors import InputError
from nathlon.sim.world import World
from tests.policies.test_plugin import install
from tests.support.checkpoints import BUNDLED

pytestmark = pytest.mark.takes_long

CODE = '''
import os
import time

import numpy as np
from nathlon.sim.observation import ObservationSpec


class Rogue:
    """Full throttle, until its fifth answer."""

    observation_spec = ObservationSpec(course_points=1)

    def __init__(self, kind):
        self.kind = kind

    def initial_memory(self, n):
        return np.zeros((n + (self.kind == "initial_memory"), 1), np.float32)

    def act(self, observations, memory):
        actions = np.tile(np.array([[1.0, 0.0]], np.float32), (len(observations), 1))
        memory = memory + np.float32(1.0)
        if memory[0, 0] < 5.0:
            return actions, memory
        if self.kind == "raises":
            raise RuntimeError("no more")
        if self.kind == "exits":
            raise SystemExit("no more")
        if self.kind == "crashes":
            os._exit(3)
        if self.kind == "hangs":
            time.sleep(3600)
        answers = {
            "nan": lambda: (actions * np.nan, memory),
            "infinite": lambda: (np.full_like(actions, np.inf), memory),
            "shape": lambda: (actions[:, :1], memory),
            "rows": lambda: (actions[:0], memory),
            "integers": lambda: (actions.astype(int), memory),
            "objects": lambda: (actions.astype(object), memory),
            "list": lambda: (actions.tolist(), memory),
            "nothing": lambda: None,
            "actions_alone": lambda: actions,
            "memory_shape": lambda: (actions, memory[:, :0]),
            "memory_list": lambda: (actions, memory.tolist()),
            "huge": lambda: (actions * np.float32(1e30), memory),
            "float64": lambda: (actions.astype(np.float64) * 1e300, memory.astype(np.float64)),
        }
        return answers.get(self.kind, lambda: (actions, memory))()


def __getattr__(kind):
    if kind.startswith("_"):
        raise AttributeError(kind)
    return lambda circuit, car: Rogue(kind)
'''

ENDINGS = {
    "raises": "policy_raised",
    "exits": "policy_raised",
    "nan": "illegal_action",
    "infinite": "illegal_action",
    "shape": "illegal_action",
    "rows": "illegal_action",
    "integers": "illegal_action",
    "objects": "illegal_action",
    "list": "illegal_action",
    "nothing": "illegal_action",
    "actions_alone": "illegal_action",
    "memory_shape": "illegal_action",
    "memory_list": "illegal_action",
    "initial_memory": "illegal_action",
}
HARMLESS = ("straight", "huge", "float64")
STOPPING = {"crashes": "policy_raised", "hangs": "timed_out"}
KINDS = (*ENDINGS, *HARMLESS, *STOPPING)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with all rogues, installed for this process and those that it starts."""
    site = tmp_path / "site"
    site.mkdir()
    (site / "rogues.py").write_text(CODE)
    install(site, "rogues", "[nathlon.policies]\n" + "".join(f"{kind} = rogues:{kind}\n" for kind in KINDS))
    monkeypatch.syspath_prepend(site)
    monkeypatch.delitem(sys.modules, "rogues", raising=False)
    return site


def race(*sources: str, seed: int = 1) -> Match:
    """One race of two cars."""
    ids = tuple(enter(source, "lindenring", "gt3").id for source in sources)
    seats = tuple(Seat(k % len(sources)) for k in range(2))
    name = "slipstream_pass"
    return Match("race", name, name, "lindenring", "gt3", ids, sources, (Race(seed, seats),))


@pytest.mark.parametrize("kind", ENDINGS)
def test_a_faulty_answer_puts_its_cars_out_and_the_others_race_on(site: Path, kind: str) -> None:
    match = race(f"plugin:{kind}", "driver")
    faulty, other = run_match(match, match_policies(match)).sort("car").iter_rows(named=True)
    assert faulty["ending"] == ENDINGS[kind]
    assert faulty["driven_s"] == pytest.approx(0.0 if kind == "initial_memory" else 0.4)
    assert (faulty["place"], other["place"], other["ending"]) == (2, 1, "finished")


def test_values_out_of_range_are_clipped_in_any_floating_type(site: Path) -> None:
    results = []
    for kind in HARMLESS:
        match = race(f"plugin:{kind}", "driver")
        results.append(run_match(match, match_policies(match)).drop("match", "entrant"))
    assert results[0].equals(results[1])
    assert results[0].equals(results[2])


def test_policies_that_stop_their_worker_are_told_apart_and_the_rest_is_not_lost(site: Path) -> None:
    """All in one world, so that what is lost with a worker has company."""
    kinds = [*STOPPING, "raises", "straight"]
    matches = {kind: race(f"plugin:{kind}", "plugin:huge") for kind in kinds}
    with Pool(1, answer_s=1.0) as pool:
        results = {match.key: frame for match, frame in pool.run(list(matches.values()))}
    for kind, match in matches.items():
        if kind in STOPPING:
            faulty, other = results[match.key].sort("car").iter_rows(named=True)
            assert faulty["ending"] == STOPPING[kind]
            assert (faulty["place"], faulty["driven_s"], faulty["distance_m"]) == (2, 0.0, 0.0)
            assert other["place"] == 1
            assert other["distance_m"] > 100.0
        policies: list[Policy | Absent] = [*match_policies(match)]
        if kind in STOPPING:
            policies[0] = Absent(STOPPING[kind])
        assert results[match.key].equals(run_match(match, policies))


def test_races_are_recorded_behind_the_same_watch(site: Path) -> None:
    """What stops a worker when it is run stops it when it is recorded, and ends the same way."""
    matches = {kind: race(f"plugin:{kind}", "driver") for kind in (*STOPPING, "straight")}
    gone = replace(matches["straight"], sources=("gone.safetensors", "driver"))
    with Pool(1, answer_s=1.0) as pool:
        run = {match.key: frame for match, frame in pool.run(list(matches.values()))}
        wanted = [
            Wanted(match, (0,), ("rogue", "driver"), run[match.key].sort("race", "car"))
            for match in (gone, *matches.values())
        ]
        recorded = dict(pool.record(wanted))
    assert isinstance(recorded.pop(gone), InputError)
    assert len(recorded) == 3
    for match, answer in recorded.items():
        assert not isinstance(answer, InputError)
        distance = run[match.key].sort("car")["distance_m"]
        np.testing.assert_array_equal(answer.logs[0].samples["distance_m"][-1], distance)


def test_a_policy_that_is_another_one_by_now_is_refused_after_the_others_have_run(
    site: Path, tmp_path: Path
) -> None:
    path = tmp_path / "latest.safetensors"
    path.write_bytes(BUNDLED[0].read_bytes())
    matches = [race(str(path)), race("plugin:straight"), race(str(BUNDLED[2]))]
    path.write_bytes(BUNDLED[1].read_bytes())
    (site / "rogues.py").write_text(CODE + "# another version\n")
    with Pool(1) as pool:
        results = pool.run(matches)
        assert next(results)[0] == matches[-1]
        with pytest.raises(InputError, match="has changed since it was entered"):
            next(results)
    path.unlink()
    with pytest.raises(InputError, match=r"latest\.safetensors: cannot read the policy: No such file"):
        match_policies(matches[0])


class Breaking:
    """Breaks the simulator at a given time by way of the observer; drives gently."""

    def __init__(self, after_s: float, race: int, car: int) -> None:
        self._after_s, self._race, self._car = after_s, race, car

    def __call__(self, world: World) -> None:
        if world.time[self._race] >= self._after_s:
            world.state["world_velocity_x"][self._race, self._car] = np.nan


def test_a_world_that_is_not_finite_voids_its_race_and_no_other() -> None:
    seats = (Seat(0), Seat(1))
    name = "slipstream_pass"
    entrants = ("driver", "driver:pace=0.85")
    races = tuple(Race(seed, seats) for seed in range(3))
    match = Match("race", name, name, "lindenring", "gt3", entrants, entrants, races)
    policies: list[Policy] = [Driver("lindenring", "gt3"), Driver("lindenring", "gt3", pace=0.85)]
    whole = run_match(match, policies)
    broken = run_match(match, policies, Breaking(3.0, 1, 0))
    assert broken.filter(pl.col("race") != 1).equals(whole.filter(pl.col("race") != 1))
    assert broken.filter(pl.col("race") == 1).equals(void(match).filter(pl.col("race") == 1))
    assert set(void(match)["ending"]) == {"simulator_fault"}
    assert void(match).schema == RESULTS
    cars, endings = np.full((3, 2), BLANK), np.full((3, 2), "simulator_fault")
    assert classify(match, cars, endings, np.zeros((3, 2)), {(0, 0): "any"}).equals(void(match))
