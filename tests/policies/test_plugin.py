"""Policies of installed packages: found by their entry point, known by their files, loaded only by name."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from nathlon.arena.entrance import enter_all
from nathlon.arena.entrant import enter
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.pool import Pool
from nathlon.arena.runner import run_match
from nathlon.policies.load import load_policy
from nathlon.sim.errors import InputError

CODE = '''
import numpy as np
from nathlon.sim.observation import ObservationSpec


class Straight:
    """Full throttle, straight on."""

    observation_spec = ObservationSpec(course_points=1)

    def __init__(self, circuit, car):
        self.made_for = (circuit, car)

    def initial_memory(self, n):
        return np.zeros((n, 0), np.float32)

    def act(self, observations, memory):
        return np.tile(np.array([[1.0, 0.0]], np.float32), (len(observations), 1)), memory


class Nothing:
    """No policy."""

    def __init__(self, circuit, car):
        pass


def failing(circuit, car):
    raise RuntimeError("out of fuel")
'''

POINTS = """
[nathlon.policies]
straight = racers.drivers:Straight
broken = racers.drivers:failing
absent = racers.drivers:Nobody
number = racers.drivers:Nothing
lost = nowhere:Policy
single = lone:Straight
"""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of installed packages: one package and one module, with their entry points."""
    site = tmp_path / "site"
    (site / "racers").mkdir(parents=True)
    (site / "racers" / "__init__.py").write_text("")
    (site / "racers" / "drivers.py").write_text(CODE)
    (site / "lone.py").write_text(CODE)
    install(site, "racers", POINTS)
    monkeypatch.syspath_prepend(site)
    for module in ("racers", "racers.drivers", "lone"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    return site


def install(site: Path, name: str, points: str) -> None:
    """Declare a distribution with entry points."""
    info = site / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(points)


def identity(name: str = "straight") -> str:
    """The id under which a plugin is entered."""
    return enter(f"plugin:{name}", "lindenring", "gt3").id


def test_a_plugin_races(site: Path, pool: Pool) -> None:
    entrants = enter_all(pool, ["plugin:straight", "driver"], "lindenring", "gt3")
    assert [(e.name, e.algorithm, e.step) for e in entrants] == [
        ("straight", "plugin", None),
        ("driver", "built-in driver", None),
    ]
    match = Match(
        "race",
        "slipstream_pass",
        "slipstream_pass",
        "lindenring",
        "gt3",
        tuple(entrant.id for entrant in entrants),
        tuple(entrant.source for entrant in entrants),
        (Race(1, (Seat(0), Seat(1))),),
    )
    results = run_match(match, match_policies(match)).sort("car")
    assert "policy_raised" not in results["ending"].to_list()
    assert min(results["distance_m"].to_list()) > 100.0


def test_it_is_made_for_the_circuit_and_the_car(site: Path) -> None:
    assert vars(load_policy("plugin:straight", "oval", "kart")) == {"made_for": ("oval", "kart")}


def test_nothing_of_it_is_imported_unless_it_is_named(site: Path) -> None:
    load_policy("driver", "lindenring", "gt3")
    with pytest.raises(InputError, match="no package offers"):
        load_policy("plugin:nobody", "lindenring", "gt3")
    assert not {"racers", "lone"} & set(sys.modules)


def test_it_is_known_by_the_files_of_its_package(site: Path) -> None:
    before = identity()
    (site / "racers" / "__pycache__").mkdir(exist_ok=True)
    (site / "racers" / "__pycache__" / "drivers.cpython-311.pyc").write_bytes(b"compiled")
    assert identity() == before, "compiled files do not count"
    (site / "racers" / "weights.bin").write_bytes(b"1")
    after = identity()
    assert after != before
    (site / "racers" / "weights.bin").write_bytes(b"2")
    assert identity() not in (before, after)


def test_it_may_be_a_single_module(site: Path) -> None:
    before = identity("single")
    (site / "other.py").write_text("")
    assert identity("single") == before
    (site / "lone.py").write_text(CODE + "\n")
    assert identity("single") != before


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nobody", "no package offers this policy; .* absent, broken, lost, number, single, straight"),
        ("broken", r"racers.drivers:failing raised RuntimeError \(out of fuel\)"),
        ("absent", "racers.drivers:Nobody raised AttributeError"),
        ("number", "racers.drivers:Nothing made no policy: it has no observation_spec"),
        ("lost", "nowhere:Policy raised ModuleNotFoundError"),
    ],
)
def test_what_is_no_policy_is_refused(site: Path, name: str, message: str) -> None:
    with pytest.raises(InputError, match=f"^plugin:{name}: {message}"):
        load_policy(f"plugin:{name}", "lindenring", "gt3")


def test_a_name_offered_twice_is_refused(site: Path) -> None:
    install(site, "rivals", "[nathlon.policies]\nstraight = lone:Straight\n")
    with pytest.raises(InputError, match=r"plugin:straight: offered more than once, by .*lone:Straight"):
        load_policy("plugin:straight", "lindenring", "gt3")


def test_a_plugin_of_the_version_before_is_told_what_to_change(site: Path) -> None:
    (site / "older.py").write_text("import sim\n")
    install(site, "older", "[nathlon.policies]\nolder = older:Policy\n")
    with pytest.raises(InputError, match=r"^plugin:older: older:Policy imports sim, expected nathlon\.sim$"):
        load_policy("plugin:older", "lindenring", "gt3")
