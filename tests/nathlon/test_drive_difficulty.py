"""Difficulty of a test drive: opponents of told paces, matched to what the person has driven before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from nathlon.arena.recorder import record_races
from nathlon.arena.store import Store
from nathlon.lab.drive.choice import Choice, DrivePlan, plan
from nathlon.lab.drive.difficulty import LEVELS, HeatField, field, matched, spread, tempered
from nathlon.lab.drive.forecast import HeatForecast, Setting, foretell
from nathlon.lab.drive.form import ONE_DOUBT, Form, form, pace_of
from nathlon.lab.drive.heat import DrivenHeat
from nathlon.lab.drive.keeping import keep
from nathlon.policies.load import load_policy
from nathlon.policies.sources import driver_settings
from nathlon.selection.publish.output import OutputFolder
from nathlon.sim.errors import InputError
from tests.support.command_line import nathlon, refused
from tests.support.drives import choice, offer

CIRCUIT, CAR = "lindenring", "gt3"
PACE = 0.83


def drawn(made: DrivePlan) -> DrivenHeat:
    """A race alone in which the person is the built-in driver at a pace."""
    person = load_policy(f"driver:pace={PACE}", CIRCUIT, CAR)
    recorded = record_races(made.match, [person], [0], made.names)
    return DrivenHeat(made, np.zeros((1, 2), np.float32), recorded.results, recorded.logs[0])


@pytest.fixture(scope="module")
def driven() -> DrivenHeat:
    return drawn(plan(choice(cars=1, seat=1, opponents=()), offer()))


def race_time_s(driven: DrivenHeat) -> float:
    return float(driven.results["race_time_s"][0])


def test_a_race_as_long_as_the_drivers_shows_its_pace(driven: DrivenHeat, tmp_path: Path) -> None:
    output = OutputFolder(tmp_path)
    assert form(output.store, "Ada", CIRCUIT, CAR) is None
    keep(driven, output)
    shown = form(output.store, "Ada", CIRCUIT, CAR)
    assert shown is not None
    assert shown.pace == pytest.approx(PACE, abs=0.004)
    assert (shown.doubt, shown.drives) == (ONE_DOUBT, 1)
    for name, circuit, car in (
        ("Bob", CIRCUIT, CAR),
        ("Ada", "porto-sereno", CAR),
        ("Ada", CIRCUIT, "coupe"),
    ):
        assert form(output.store, name, circuit, car) is None


def test_a_forecast_race_is_held_against_who_drove_it_before(driven: DrivenHeat, tmp_path: Path) -> None:
    """Somebody who took 2 % less time than their stand-in is 2 % faster, whatever the others cost both.

    And whatever they did alone before.
    """
    output, took_s = OutputFolder(tmp_path), race_time_s(driven)
    keep(driven, output)
    for number, ratio in enumerate((1.02, 1.04)):
        forecast = HeatForecast(0.9, 1, 1.0, 1, 1, ratio * took_s)
        made = driven.plan._replace(field=HeatField((), "", forecast))
        controls = np.full((1, 2), 0.1 * (number + 1), np.float32)
        keep(driven._replace(plan=made, controls=controls), output)
    shown = form(output.store, "Ada", CIRCUIT, CAR)
    assert shown is not None
    assert shown.pace == pytest.approx(0.9 * 1.03)
    assert shown.doubt == pytest.approx(0.9 * 0.02 / 2**0.5)
    with Store.open(output.store) as store:
        told: Any = store.facts(store.runs()[1].name)["forecast"]
    assert told["race_time_s"] == pytest.approx(1.02 * took_s)


def test_a_race_that_was_not_finished_shows_nothing(driven: DrivenHeat, tmp_path: Path) -> None:
    output, results = OutputFolder(tmp_path), driven.results
    lost = results.with_columns(results["race_time_s"].clear(1), pl.lit("stuck").alias("ending"))
    keep(driven._replace(results=lost), output)
    assert form(output.store, "Ada", CIRCUIT, CAR) is None


def test_longer_laps_are_of_a_slower_pace() -> None:
    times = [100.0, 120.0, 140.0]
    paces = [pace_of(time_s, CIRCUIT, CAR, 1) for time_s in times]
    assert paces[0] > paces[1] > paces[2]


@pytest.mark.parametrize("seat", [1, 5])
def test_whoever_is_matched_is_expected_in_the_middle(seat: int) -> None:
    """The car that starts last has cars to pass and gets slower ones than the first."""
    setting, shown = Setting(CIRCUIT, CAR, 5, seat, 1), Form(0.88, 0.01, 2)
    paces = matched(setting, shown, "fair")
    assert paces == sorted(paces, reverse=True)
    assert len(set(paces)) == 4
    sources = [f"driver:pace={pace:.4f}" for pace in paces]
    assert foretell(setting, sources, shown).place == pytest.approx(3.0, abs=1.0)
    assert (np.mean(paces) > shown.pace) == (seat == 1)


def test_levels_follow_each_other_and_every_car_is_told(tmp_path: Path) -> None:
    setting, store = Setting(CIRCUIT, CAR, 4, 4, 3), tmp_path / "store.sqlite"
    ends = [pace for name in ("beginner", "intermediate", "expert") for pace in LEVELS[name]]
    assert ends == sorted(ends)
    made = field("expert", "calm", setting, store, "Ada")
    told = [driver_settings(source) for source in made.sources]
    assert [one.pace for one in told] == [1.0, 0.96, 0.92]
    assert {one.temper for one in told} == {"calm"}
    assert made.forecast is None
    assert (
        made.words
        == "Opponents: the built-in driver at 92.0 to 100.0 % of its pace, calm; no other handicap."
    )
    assert spread(0.8, 0.9, 1) == [pytest.approx(0.85)]


def test_who_has_not_driven_cannot_be_matched(tmp_path: Path) -> None:
    setting, store = Setting(CIRCUIT, CAR, 4, 4, 3), tmp_path / "store.sqlite"
    with pytest.raises(InputError, match="match me: Ada has finished no drive here yet, expected one"):
        field("match", "fair", setting, store, "Ada")
    with pytest.raises(InputError, match="the choice: beginner and 1 car, expected at least two"):
        field("beginner", "fair", setting._replace(cars=1, seat=1), store, "Ada")


def test_only_the_built_in_driver_takes_a_temper() -> None:
    assert tempered("driver", "calm") == "driver:temper=calm"
    assert tempered("driver:pace=0.9", "aggressive") == "driver:pace=0.9,temper=aggressive"
    assert tempered("driver:pace=0.9", "fair") == "driver:pace=0.9"
    assert tempered("driver:temper=calm", "aggressive") == "driver:temper=calm"
    assert tempered("a.safetensors", "calm") == "a.safetensors"
    made = plan(choice(temper="calm"), offer())
    assert made.grid[0] == "driver:pace=0.9,temper=calm"


def test_a_choice_of_a_difficulty_needs_no_opponents() -> None:
    facts = choice().model_dump(mode="json") | {"opponents": [], "difficulty": "match", "temper": "calm"}
    assert Choice.read(facts).difficulty == "match"
    with pytest.raises(InputError, match=r"the choice: .*difficulty is 'heroic'"):
        Choice.read(facts | {"difficulty": "heroic"})


def test_a_blind_drive_has_no_difficulty(tmp_path: Path) -> None:
    done = nathlon("drive", "--blind", "--run", "night", "--driver", "ann", "--temper", "calm", cwd=tmp_path)
    refused(done, "--temper calm: expected what the run has raced, with --blind")
