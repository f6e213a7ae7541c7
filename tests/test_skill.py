"""Skill tests: their files, and marks and points from results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import polars as pl
import pytest

from arena.results import RESULTS
from nathlon.skill import SKILLS_FOLDER, measure_runs, read_skill, shipped_skills
from sim.errors import InputError

SHIPPED = {skill.name: skill for skill in shipped_skills()}


def result(run: int, entrant: str, time: float | None, blame: int = 0) -> dict[str, Any]:
    return {
        **dict.fromkeys(RESULTS.names()),
        "race": run,
        "car": 0 if entrant == "me" else 1,
        "entrant": entrant,
        "race_time_s": time,
        "driven_s": time or 40.0,
        "contacts_faster_behind": blame,
    }


def test_three_tests_ship() -> None:
    assert set(SHIPPED) == {"standing start", "slipstream pass", "chicane in traffic"}


def test_the_marks_give_500_and_1000_points() -> None:
    for skill in SHIPPED.values():
        points = skill.points().points([skill.scoring.base, skill.scoring.reference])
        assert points == pytest.approx([500.0, 1000.0])


def test_a_time_is_worsened_by_contacts_and_a_run_without_a_time_scores_nothing() -> None:
    skill = SHIPPED["standing start"]
    results = pl.DataFrame(
        [result(0, "me", 30.0, blame=2), result(1, "me", None), result(2, "me", 5.0)], schema=RESULTS
    )
    marks = measure_runs(skill, "me", results)
    assert marks["measure"].to_list() == [30.0 + 2 * skill.contact_penalty_s, None, skill.scoring.limit]
    assert marks["points"][1] == 0.0
    assert marks["points"][0] == pytest.approx(float(skill.points().points(31.0)))


def test_a_lead_is_over_the_best_opponent() -> None:
    skill = SHIPPED["slipstream pass"]
    rows = [
        result(0, "me", 19.0),
        result(0, "you", 20.5),
        result(1, "me", 21.0, blame=1),
        result(1, "you", 20.5),
        result(2, "me", 19.0),
        result(2, "you", None),
    ]
    marks = measure_runs(skill, "me", pl.DataFrame(rows, schema=RESULTS))
    assert marks["measure"].to_list() == pytest.approx([1.5, -0.5 - skill.contact_penalty_s, 3.0])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("runs = 8", "runs = 0", "runs"),
        ("runs = 8", "runs = 8\nwalks = 8", "walks"),
        ("slots = [2]", "slots = [3]", "places from 1 to 2"),
        ("reference = ", "reference = -", "better"),
        ("opponents = [", "opponents = []#", "opponents"),
    ],
)
def test_a_wrong_file_names_itself_and_the_field(tmp_path: Path, old: str, new: str, said: str) -> None:
    text = (SKILLS_FOLDER / "slipstream_pass.toml").read_text()
    assert old in text
    path = tmp_path / "skill.toml"
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=said) as error:
        read_skill(path)
    assert str(path) in str(error.value)
