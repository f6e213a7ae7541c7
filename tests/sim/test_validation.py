"""Numbers, switches and text of files stay what they are."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from pydantic import BaseModel, Field

from nathlon.lab.reward.records import JUDGED, read_record
from nathlon.policies.sources.composite import CompositeSource
from nathlon.selection.battery.skill import SKILLS_FOLDER, read_skill
from nathlon.selection.config import read_config
from nathlon.sim.car import load_car
from nathlon.sim.data_file import DATA, checked
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.scenario import load_scenario
from nathlon.sim.track.formats.maps import read_geojson
from nathlon.sim.validation import read_json


class Inner(BaseModel):
    whole: int = Field(default=1, alias="count")
    ratio: float = 1.0
    on: bool = True


class Outer(BaseModel):
    inner: tuple[Inner, ...] = ()
    by_name: dict[str, float] = {}
    either: int | str = 0
    maybe: float | None = None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            '{"inner": [{"count": 2}, {"count": true}]}',
            "field inner.1.count is True: Input should be a number",
        ),
        ('{"inner": [{"ratio": false}]}', "field inner.0.ratio is False: Input should be a number"),
        ('{"inner": [{"ratio": "3.5"}]}', "field inner.0.ratio is '3.5': Input should be a number"),
        ('{"inner": [{"on": 1}]}', "field inner.0.on is 1: Input should be true or false"),
        ('{"inner": [{"on": "yes"}]}', "field inner.0.on is 'yes': Input should be true or false"),
        ('{"by_name": {"a": true}}', "field by_name.a is True: Input should be a number"),
        ('{"maybe": true}', "field maybe is True: Input should be a number"),
    ],
)
def test_nothing_is_converted(text: str, said: str) -> None:
    with pytest.raises(InputError, match=f"^here: {said}"):
        read_json(text, Outer, "here")


def test_whole_numbers_with_a_point_and_numbers_without_one_are_numbers() -> None:
    read = read_json(
        '{"inner": [{"count": 2.0, "ratio": 3, "on": false}], "maybe": null, "either": "1"}', Outer, "here"
    )
    assert read == Outer(inner=(Inner(count=2, ratio=3.0, on=False),), either="1")
    assert checked({"by_name": {"a": 1}}, Outer, "here").by_name == {"a": 1.0}


COMPOSITE = """
name = "one"
[[part]]
policy = "driver"
until_m = 100.0
[[part]]
policy = "driver"
[[stint]]
compound = "racing-medium"
laps = 2
"""
NIGHT = """
seed = 1
[nightly]
incumbents = 3
max_fault_share = 0.1
[committee]
shortlist = 6
"""
READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "scenario": (
        (DATA / "scenarios/grand_prix_stops.toml").read_text(),
        lambda path: load_scenario(str(path)),
    ),
    "car": ((DATA / "cars/gt3.toml").read_text(), lambda path: load_car(str(path))),
    "skill": ((SKILLS_FOLDER / "race_craft.toml").read_text(), read_skill),
    "composite": (COMPOSITE, CompositeSource.read),
    "night": (NIGHT, read_config),
}


@pytest.mark.parametrize(
    ("kind", "before", "after"),
    [
        ("scenario", "laps = 12", "laps = true"),
        ("scenario", "speed_m_s = 25.0", 'speed_m_s = "25.0"'),
        ("car", "mass_kg = 1370.0", 'mass_kg = "1370.0"'),
        ("skill", "runs = 6", "runs = true"),
        ("skill", "slots = [8]", "slots = [true]"),
        ("composite", "laps = 2", "laps = true"),
        ("composite", "until_m = 100.0", "until_m = true"),
        ("night", "seed = 1", "seed = true"),
        ("night", "incumbents = 3", "incumbents = false"),
        ("night", "max_fault_share = 0.1", 'max_fault_share = "0.1"'),
        ("night", "shortlist = 6", "shortlist = true"),
    ],
)
def test_files_that_people_write_are_taken_at_their_word(
    tmp_path: Path, kind: str, before: str, after: str
) -> None:
    text, read = READERS[kind]
    path = tmp_path / "mine.toml"
    path.write_text(text, "utf-8")
    read(path)
    assert before in text
    other = tmp_path / "other.toml"
    other.write_text(text.replace(before, after, 1), "utf-8")
    with pytest.raises(
        InputError, match=rf"other\.toml: field .*{before.split()[0]}.*: Input should be a number"
    ):
        read(other)


def test_so_are_records_and_observations(tmp_path: Path) -> None:
    (tmp_path / "judged.json").write_text('{"over": 1}')
    with pytest.raises(InputError, match=r"judged\.json: over: Input should be true or false"):
        read_record(tmp_path / "judged.json", JUDGED)
    for wrong in ({"course_points": True}, {"plan_pace": True}, {"horizon_s": True}):
        with pytest.raises(InputError, match="is True, expected a number"):
            ObservationSpec.from_dict(wrong)
    line = [[0, 0], [0, 0.001], [0.001, 0.001], [True, False]]
    with pytest.raises(InputError, match="'True', expected a number"):
        read_geojson(json.dumps({"type": "LineString", "coordinates": line}))
