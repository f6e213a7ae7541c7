"""The configuration: what counts as a change of it."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from nathlon.policies.bundled import BUNDLED, generalist
from nathlon.selection.battery.skill import SKILLS_FOLDER
from nathlon.selection.config import Config, NightlySettings, read_config
from nathlon.sim.data_file import DATA
from nathlon.sim.errors import InputError
from nathlon.sim.scenario import load_scenario

NIGHT = """
checkpoints = ["checkpoints"]
[battery]
tests = ["hot_lap", "mine.toml"]
[tournament]
event = "event.toml"
[pareto]
opponents = ["OPPONENT"]
"""
EVENT = """
[[race]]
name = "long"
circuit = "lindenring"
car = "gt3"
scenario = "race:laps=3"
weight = 2.0
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A configuration that names a test with a scenario of its own, an event and a checkpoint."""
    skill = (SKILLS_FOLDER / "race_craft.toml").read_text("utf-8")
    scenario, opponent = tmp_path / "rain.toml", tmp_path / "opponent.safetensors"
    shutil.copy(DATA / "scenarios" / "sprint.toml", scenario)
    shutil.copy(BUNDLED / "lindenring" / "lindenring-s1-040k.safetensors", opponent)
    (tmp_path / "mine.toml").write_text(skill.replace('"sprint"', f'"{scenario}"'), "utf-8")
    (tmp_path / "event.toml").write_text(EVENT, "utf-8")
    (tmp_path / "nathlon.toml").write_text(NIGHT.replace("OPPONENT", str(opponent)), "utf-8")
    return tmp_path


def digest(folder: Path) -> str:
    load_scenario.cache_clear()
    return read_config(folder / "nathlon.toml").digest


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [
        ("mine.toml", "runs = 6", "runs = 7"),
        ("mine.toml", "reference_gain = 0.1", "reference_gain = 0.11"),
        ("rain.toml", "laps = 1", "laps = 2"),
        ("event.toml", "weight = 2.0", "weight = 3.0"),
        ("event.toml", "laps=3", "laps=4"),
        ("nathlon.toml", "[battery]", "seed = 2\n[battery]"),
    ],
)
def test_what_a_named_file_says_is_part_of_it(folder: Path, file: str, before: str, after: str) -> None:
    first = digest(folder)
    text = (folder / file).read_text("utf-8")
    assert before in text
    (folder / file).write_text("# a remark changes nothing\n" + text, "utf-8")
    assert digest(folder) == first
    (folder / file).write_text(text.replace(before, after), "utf-8")
    assert digest(folder) != first


def test_another_checkpoint_of_the_same_name_is_a_change(folder: Path) -> None:
    first = digest(folder)
    shutil.copy(BUNDLED / "lindenring" / "lindenring-s1-036k.safetensors", folder / "opponent.safetensors")
    assert digest(folder) != first


def test_where_things_lie_and_who_works_is_no_part_of_it(folder: Path) -> None:
    first = digest(folder)
    text = (folder / "nathlon.toml").read_text("utf-8")
    (folder / "nathlon.toml").write_text(
        'out = "else"\nstore = "other.sqlite"\nworkers = 7\n' + text, "utf-8"
    )
    assert digest(folder) == first


def test_a_file_that_is_gone_is_one_sentence(folder: Path) -> None:
    os.remove(folder / "event.toml")
    with pytest.raises(InputError, match=r"event\.toml: cannot read the event file"):
        digest(folder)


def test_what_a_file_leaves_out_stays_a_default(tmp_path: Path) -> None:
    path = tmp_path / "nathlon.toml"
    path.write_text("[battery]\nruns = 3\n[nightly]\nincumbents = 1\n", "utf-8")
    config = read_config(path)
    assert config.battery.model_fields_set == {"runs"}
    assert config.nightly.model_fields_set == {"incumbents"}


def test_names_are_no_paths_but_the_generalists_is_that_of_its_file(tmp_path: Path) -> None:
    path = tmp_path / "nathlon.toml"
    path.write_text('checkpoints = ["runs", "generalist"]\n[nightly]\nanchors = ["driver", "generalist"]\n')
    config = read_config(path)
    assert config.checkpoints == (str(tmp_path / "runs"), str(generalist()))
    assert config.nightly.anchors == ("driver", str(generalist()))
    assert generalist().parent.name == "generalist"


def test_the_generalist_is_an_anchor_where_no_champion_is_at_home() -> None:
    baseline = NightlySettings().anchors
    assert Config(circuit="lindenring", car="gt3").suited.nightly.anchors == baseline
    elsewhere = Config(circuit="lindenring", car="coupe")
    assert elsewhere.suited.nightly.anchors == (*baseline, str(generalist()))
    assert elsewhere.suited.suited == elsewhere.suited
    chosen = elsewhere.model_copy(update={"nightly": NightlySettings(anchors=("driver",))})
    assert chosen.suited.nightly.anchors == ("driver",)


@pytest.mark.parametrize("field", ["out", "store"])
def test_a_zero_byte_in_a_path_is_refused(field: str, tmp_path: Path) -> None:
    path = tmp_path / "nathlon.toml"
    path.write_text(f'{field} = "a\\u0000b"\n')
    with pytest.raises(InputError, match=r"nathlon\.toml: 'a\\x00b' is no path: a name has no zero byte"):
        read_config(path)


@pytest.mark.parametrize(
    ("given", "twice"),
    [
        ('scenarios = ["sprint", "following", "sprint"]', "scenarios has 'sprint' twice"),
        ('circuits = ["lindenring", "lindenring"]', "circuits has 'lindenring' twice"),
        ("delays_s = [0.1, 0.1001]", "delays_s has 0.1 twice"),  # to the nearest 1/60 s
        ("places = [1, 2, 2]", "places has 2 twice"),
    ],
)
def test_a_setting_of_the_matrix_that_is_given_twice_is_refused(
    given: str, twice: str, tmp_path: Path
) -> None:
    """Its cells would be counted twice: among those that got worse, and in what chance may call worse."""
    path = tmp_path / "nathlon.toml"
    path.write_text(f"[matrix]\n{given}\n")
    with pytest.raises(InputError, match=twice):
        read_config(path)
