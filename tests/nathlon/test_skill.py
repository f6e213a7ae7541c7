"""Skill tests: their files, the marks that the built-in driver sets, and the points of runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nathlon.arena.match import NO_TEAM, TESTED
from nathlon.arena.results import RESULTS
from nathlon.arena.world_finding import RACING
from nathlon.arena.world_registry import load_world
from nathlon.selection.battery import DECATHLON, ON_REQUEST
from nathlon.selection.battery.measures import MEASURES, measured
from nathlon.selection.battery.place import stretch
from nathlon.selection.battery.skill import SKILLS_FOLDER, Gains, Marks, Skill, load_skills, read_skill
from nathlon.sim.errors import InputError
from nathlon.sim.track import load_track
from tests.support.race_results import DEFAULTS
from tests.support.refusals import refusal

SHIPPED = {skill.name: skill for skill in load_skills(DECATHLON)}
PASS = SHIPPED["pass on the right"]
HOT_LAP = SHIPPED["hot lap"]


def race(skill: Skill, run: int, own: dict[str, Any], **others: Any) -> list[dict[str, Any]]:
    """Rows of a run of a skill with two cars."""
    return [
        DEFAULTS
        | {"race": run, "car": slot - 1, "slot": slot, "entrant": "driver"}
        | {"team": TESTED if slot == skill.slot(run) else NO_TEAM}
        | (own if slot == skill.slot(run) else others)
        for slot in (1, 2)
    ]


def runs_of(skill: Skill, *races: list[dict[str, Any]]) -> list[tuple[int, float | None]]:
    rows = [row for rows in races for row in rows]
    return skill.runs_of(pl.DataFrame(rows, schema=RESULTS), MEASURES[skill.measure])


def marks_of(skill: Skill, found: list[tuple[int, float | None]]) -> Marks | None:
    return skill.marks(found, MEASURES[skill.measure])


def numbered(marks: list[float | None]) -> list[tuple[int, float | None]]:
    return list(enumerate(marks))


def test_all_that_ships_is_in_the_decathlon_or_held_on_request() -> None:
    assert sorted(DECATHLON + ON_REQUEST) == sorted(path.stem for path in SKILLS_FOLDER.glob("*.toml"))
    assert len(SHIPPED) == len(DECATHLON)
    assert len(load_skills(ON_REQUEST)) == len(ON_REQUEST)


def test_the_own_run_is_known_by_who_is_tested_and_not_by_its_entrant() -> None:
    skill = PASS.model_copy(update={"slots": (1, 2)})
    races = [race(skill, run, {"race_time_s": 20.0}, race_time_s=20.0 + run) for run in range(3)]
    assert runs_of(skill, *races) == [(0, 0.0), (1, 1.0), (2, 2.0)]


def test_contacts_at_fault_worsen_a_lead_and_a_time() -> None:
    own = {"race_time_s": 20.0, "contacts": 5, "contacts_at_fault": 2}
    assert runs_of(PASS, race(PASS, 0, own, race_time_s=22.0)) == [(0, 2.0 - 2 * PASS.contact_penalty)]
    timed = PASS.model_copy(update={"measure": "time"})
    assert runs_of(timed, race(timed, 0, own)) == [(0, 20.0 + 2 * PASS.contact_penalty)]


def test_void_races_are_left_out_and_policy_faults_set_no_mark() -> None:
    place = PASS.model_copy(update={"measure": "place"})
    races = [
        race(place, 0, {"ending": "policy_raised"}),
        race(place, 1, {}, ending="simulator_fault"),
        race(place, 2, {"ending": "stuck", "place": 2}),
        race(place, 3, {"place": 1}, ending="policy_raised"),
    ]
    assert runs_of(place, *races) == [(0, None), (2, 2.0), (3, 1.0)]


@pytest.mark.parametrize("skill", SHIPPED.values(), ids=SHIPPED)
@given(st.lists(st.floats(20.0, 21.0), min_size=2, max_size=16))
def test_the_driver_averages_500_points_and_the_reference_gives_1000(
    skill: Skill, found: list[float]
) -> None:
    marks = marks_of(skill, numbered([*found]))
    assert marks is not None
    assert marks.points(found).mean() == pytest.approx(500.0, abs=0.01)
    assert marks.points([marks.base, marks.reference]) == pytest.approx([500.0, 1000.0])


def test_gains_are_shares_of_a_time_and_absolute_for_a_lead() -> None:
    lap = marks_of(HOT_LAP, numbered([100.0] * 4))
    assert lap is not None
    gains = HOT_LAP.scoring
    assert lap.base == pytest.approx(100.0)
    assert lap.reference == pytest.approx(100.0 * (1 - gains.reference_gain))
    assert lap.limit == pytest.approx(100.0 * (1 - gains.limit_gain))
    lead = marks_of(PASS, numbered([-2.0] * 4))
    assert lead is not None
    assert lead.reference == pytest.approx(-2.0 + PASS.scoring.reference_gain)


def test_the_marks_move_with_the_driver() -> None:
    one, other = (marks_of(HOT_LAP, numbered([lap] * 4)) for lap in (100.0, 200.0))
    assert one is not None
    assert other is not None
    times = np.array([94.0, 99.0, 103.0])
    np.testing.assert_allclose(one.points(times), other.points(2 * times))


def test_accidents_of_the_driver_make_the_marks_easier() -> None:
    marks = marks_of(HOT_LAP, numbered([100.0, 100.0, 100.0, None]))
    assert marks is not None
    assert marks.base > 100.0
    assert 3 * float(marks.points(100.0)) == pytest.approx(4 * 500.0)


@pytest.mark.parametrize("found", [[], [None] * 4, [100.0, None, None, None]])
def test_a_driver_that_fails_sets_no_marks(found: list[float | None]) -> None:
    assert marks_of(HOT_LAP, numbered(found)) is None


def test_nothing_counts_for_more_than_the_limit() -> None:
    gains = Gains(reference_gain=1.0, limit_gain=2.0, exponent=1.5)
    time, lead = Marks.about(20.0, "time", gains, 1.0), Marks.about(0.0, "distance", gains, 1.0)
    np.testing.assert_allclose(time.points([18.0, 10.0, 0.0]), time.points(18.0))
    np.testing.assert_allclose(lead.points([2.0, 10.0]), lead.points(2.0))
    np.testing.assert_array_equal(lead.points([-100.0, np.nan]), 0.0)


def test_a_table_has_points_for_every_run() -> None:
    marks = marks_of(HOT_LAP, numbered([100.0] * 4))
    assert marks is not None
    table = HOT_LAP.table("me", [(0, 100.0), (2, None)], marks, "s")
    assert table.select("entrant", "test", "run", "measure", "unit").rows() == [
        ("me", "hot lap", 0, 100.0, "s"),
        ("me", "hot lap", 2, None, "s"),
    ]
    assert table["points"].to_list() == pytest.approx([500.0, 0.0])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('measure = "lead"', 'measure = "lead"\nruns = 0', "field runs is 0"),
        ('measure = "lead"', 'measure = "lead"\nwalks = 8', "field walks"),
        ("slots = [2]", "slots = [3]", "slots is .3.: expected places from 1 to 2"),
        ("slots = [2]", "slots = [0]", "field slots.0 is 0"),
        ("slots = [2]", "slots = []", "field slots"),
        ('measure = "lead"', 'measure = "wit"', "measure is 'wit': expected one of time, best_lap"),
        ("reference_gain = ", "reference_gain = -", "field scoring.reference_gain is -3"),
        ("limit_gain = ", "limit_gain = 0.1 #", "limit_gain must not be less"),
        ("opponents = [", "opponents = []#", "field opponents is empty: expected someone for 1 places"),
        (
            'opponents = ["driver',
            'opponents = ["pilot',
            "opponents names 'pilot:pace=.*expected built-in drivers",
        ),
        ("slipstream_pass", "slipway", "field scenario: scenario 'slipway' is unknown"),
        (
            "slots = [2]",
            'slots = [2]\nmarks_scenario = "stint"',
            "field marks_scenario is 'stint': expected one of 2",
        ),
        ('"slipstream_pass"', '"stint"', "expected places from 1 to 1"),
    ],
)
def test_a_wrong_file_names_itself_and_the_field(tmp_path: Path, old: str, new: str, said: str) -> None:
    text = (SKILLS_FOLDER / "pass_right.toml").read_text()
    assert old in text
    path = tmp_path / "skill.toml"
    path.write_text(text.replace(old, new))
    with refusal(path, said):
        read_skill(path)


def test_alone_there_is_no_lead_and_nobody_to_race(tmp_path: Path) -> None:
    path = tmp_path / "skill.toml"
    text = (SKILLS_FOLDER / "hot_lap.toml").read_text()
    for wrong in (text.replace("best_lap", "lead"), text.replace("runs = 4", 'opponents = ["driver"]')):
        path.write_text(wrong)
        with pytest.raises(InputError, match="scenario 'stint' has one car"):
            read_skill(path)


def test_tests_are_found_by_name_or_path_and_have_names_of_their_own(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text((SKILLS_FOLDER / "hot_lap.toml").read_text().replace('"hot lap"', '"mine"'))
    assert [skill.name for skill in load_skills(["defending", str(mine)])] == ["defending", "mine"]
    with pytest.raises(InputError, match="field name is 'mine': expected one that no other test has"):
        load_skills([str(mine), str(mine)])
    with pytest.raises(InputError, match="skill 'juggling' is unknown; expected one of braking_duel"):
        load_skills(["juggling"])


def test_all_measures_are_used_or_simple_to_use() -> None:
    for name in MEASURES:
        assert measured(name, load_world(RACING)) is MEASURES[name]


def test_a_test_is_held_from_its_farthest_start_to_its_finish() -> None:
    track = load_track("lindenring")
    _, end = track.stretch("longest straight")
    held = stretch(SHIPPED["braking duel"], "lindenring")
    # From 280 to 320 m, and the second up to 2 m behind.
    np.testing.assert_allclose(held or (), (end - 321.0, end + 130.0), atol=2.0)
    front, back = (stretch(SHIPPED[f"start from the {place}"], "lindenring") for place in ("front", "back"))
    assert front is not None
    assert back is not None
    assert back[0] < front[0] < 0.0, "before the line, and the back of the grid farther"
    assert back[1] == front[1] > 0.0
    assert stretch(HOT_LAP, "lindenring") is None
    assert stretch(SHIPPED["race craft"], "lindenring") is None
