"""`summary.json`: what is written can be read, by later versions and by others."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from nathlon.results.ranks import ABSENT, written_rank
from nathlon.results.summary import VERSION, Summary, read_summary, write_summary
from nathlon.sim.errors import InputError
from tests.support.selections import build

SCHEMA = Path(__file__).parent.parent.parent / "docs" / "schema" / "summary.json"


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    summary = build(np.random.default_rng(0)).summary
    write_summary(tmp_path / "summary.json", summary)
    assert read_summary(tmp_path / "summary.json") == summary
    plain = json.loads((tmp_path / "summary.json").read_text())
    assert plain["version"] == VERSION
    assert set(plain["stages"][0]) == {"name", "in", "out", "races", "wall_s", "ran", "core_s", "void"}
    assert plain["ranking"][0]["name"] == summary.ranking[0].name


def test_fields_of_later_versions_are_passed_over_and_later_formats_refused(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    summary = build(np.random.default_rng(0)).summary
    plain = summary.model_dump(mode="json")
    path.write_text(json.dumps(plain | {"weather": "fine"}))
    assert read_summary(path) == summary
    path.write_text(json.dumps(plain | {"version": VERSION + 1}))
    with pytest.raises(InputError, match=f"field version is {VERSION + 1}, expected at most {VERSION}"):
        read_summary(path)
    path.write_text(json.dumps(plain | {"car_runs": "many"}))
    with pytest.raises(InputError, match=r"summary\.json: field car_runs is 'many'"):
        read_summary(path)
    with pytest.raises(InputError, match=r"none\.json: cannot be read"):
        read_summary(tmp_path / "none.json")


def test_the_published_schema_is_that_of_the_model() -> None:
    assert json.loads(SCHEMA.read_text("utf-8")) == Summary.model_json_schema(mode="serialization")


@pytest.mark.parametrize(
    ("best", "worst", "text"), [(1, 3, "1 to 3"), (2, 2, "2"), (2, None, "from 2"), (None, None, ABSENT)]
)
def test_a_rank_is_written_as_the_range_of_those_that_are_possible(
    best: int | None, worst: int | None, text: str
) -> None:
    assert written_rank(best, worst) == text
