"""Strategists that are a user's own code: how they are named, found, checked and told apart."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from examples import strategist as example
from nathlon.policies.load import load_policy
from nathlon.policies.sources.composite import Composite, CompositeSource
from nathlon.policies.sources.identity import policy_id
from nathlon.policies.sources.strategist import StrategistError
from nathlon.policies.strategy import Strategist
from nathlon.sim.service import Service
from tests.policies.test_stint_planner import wall
from tests.support.refusals import refusal

MINE = """
from nathlon.sim.service import Service
class Mine:
    def __init__(self, circuit, car):
        self.where = circuit, car
    def start(self, wall):
        return Service("racing-hard", wall.tank_kg)
    def decide(self, wall):
        return ANSWER
"""


def written(folder: Path, answer: str, code: str = MINE) -> Path:
    """A composite with a strategist beside it, which gives an answer."""
    (folder / "mine.py").write_text(code.replace("ANSWER", answer), "utf-8")
    path = folder / "own.toml"
    text = 'name = "own"\nstrategist = "mine.py:Mine"\n[[part]]\npolicy = "driver:pace=0.9"\n'
    path.write_text(text, "utf-8")
    return path


def strategist(path: Path) -> Strategist:
    policy = load_policy(str(path), "lindenring", "gt3")
    assert isinstance(policy, Composite)
    assert policy.strategist is not None
    return policy.strategist


def test_it_is_made_for_a_circuit_and_a_car_and_asked(tmp_path: Path) -> None:
    own = strategist(written(tmp_path, "Service(fuel_kg=30) if self.where == ('lindenring', 'gt3') else 1"))
    assert own.start(wall(0)) == Service("racing-hard", 80.0)
    assert own.decide(wall(3)) == Service(fuel_kg=30)
    assert CompositeSource.read(tmp_path / "own.toml").file.strategy_label == "Mine"


def test_its_file_is_part_of_the_entrant(tmp_path: Path) -> None:
    ids = [policy_id(str(written(tmp_path, answer))) for answer in ("None", "Service()", "None")]
    assert ids[0] == ids[2] != ids[1]


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        ("1 / 0", r"strategist Mine: decide raised ZeroDivisionError \(division by zero\)"),
        ("'box'", "strategist Mine: decide answered 'box', expected None or a Service"),
        ("Service('butter')", "strategist Mine: decide answered .*butter.*expected None or a Service"),
        ("Service(fuel_kg=float('nan'))", "strategist Mine: decide answered .*0 kg of fuel or more"),
    ],
)
def test_what_it_must_not_answer_is_told(tmp_path: Path, answer: str, said: str) -> None:
    own = strategist(written(tmp_path, answer))
    with pytest.raises(StrategistError, match=said):
        own.decide(wall(3))


PACED = (
    MINE.replace("ANSWER", "None")
    + """
    def pace(self, wall):
        return ANSWER
"""
)


def test_it_may_tell_a_pace(tmp_path: Path) -> None:
    assert strategist(written(tmp_path, "None")).pace(wall(3)) == 1.0
    assert strategist(written(tmp_path, "1 - 0.01 * wall.lap", PACED)).pace(wall(3)) == 0.97


@pytest.mark.parametrize("answer", ["None", "0.4", "float('nan')"])
def test_a_pace_that_cannot_be_is_told(tmp_path: Path, answer: str) -> None:
    own = strategist(written(tmp_path, answer, PACED))
    with pytest.raises(StrategistError, match=r"Mine: pace answered .*, expected 0\.5 to 1\.05"):
        own.pace(wall(3))


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("1 / 0", "Mine raised ZeroDivisionError .*, expected a strategist"),
        ("", "Mine raised AttributeError .*, expected a strategist"),
        ("import lies_beside", "Mine raised ModuleNotFoundError"),
        ("Mine = lambda circuit, car: 3", "Mine made no strategist: it has no method start"),
    ],
)
def test_a_file_without_a_strategist_is_named(tmp_path: Path, code: str, said: str) -> None:
    (tmp_path / "lies_beside.py").touch()
    path = written(tmp_path, "", code)
    with refusal(tmp_path / "mine.py", said):
        load_policy(str(path), "lindenring", "gt3")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('strategist = "mine.py"', "field strategist is 'mine.py'"),
        ('strategist = "mine.py:Mine"\n[[stint]]\nlaps = 3', "stint and strategist are two strategies"),
    ],
)
def test_a_composite_names_one_strategist(tmp_path: Path, line: str, said: str) -> None:
    path = tmp_path / "own.toml"
    path.write_text(f'name = "own"\n{line}\n[[part]]\npolicy = "driver:pace=0.9"\n', "utf-8")
    with refusal(path, said):
        CompositeSource.read(path)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = written(tmp_path, "None")
    (tmp_path / "mine.py").unlink()
    with refusal(tmp_path / "mine.py", "no such file, expected a strategist"):
        policy_id(str(path))


def test_the_example_covers_a_stop_of_who_is_close_behind(tmp_path: Path) -> None:
    shutil.copy(example.__file__, tmp_path / "mine.py")
    path = tmp_path / "own.toml"
    path.write_text(
        'name = "own"\nstrategist = "mine.py:Cover"\n[[part]]\npolicy = "driver:pace=0.9"\n', "utf-8"
    )
    own = strategist(path)
    near: dict[str, Any] = {
        "gap_s": np.array([0.0, 30.0]),
        "stops": np.array([0, 1]),
        "wear": np.full(4, 0.4),
    }
    assert own.decide(wall(4, **near)) == Service("racing-medium", 80.0)
    assert own.decide(wall(4, **near | {"stops": np.zeros(2, int)})) is None
    assert own.decide(wall(4, **near | {"gap_s": np.array([0.0, 90.0])})) is None
