"""Long races, weekends and seasons."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import nathlon
from nathlon.api import events
from nathlon.arena.lap_chart import LAP_CHART, running_order, stints
from nathlon.arena.leg import Leg, LegDriven, drive_leg
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.pool import Pool
from nathlon.arena.runner import run_match
from nathlon.arena.watch import Watch
from nathlon.lab.events.chapters import practice_chapter
from nathlon.lab.events.race_folder import drive_race
from nathlon.lab.events.standings import season_table
from nathlon.policies.policy import Batch
from nathlon.policies.strategy import PitWall, WhenNeeded
from nathlon.reports.event_page import lap_chapter, table_chapter, write_event_page
from nathlon.sim.car import load_car
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec
from nathlon.sim.rules import load_rules, rule_parameters
from nathlon.sim.service import Service
from nathlon.sim.weather import Weather
from tests.support.refusals import refusal


class Counting:
    """Drives off by how often it has been asked, which it must remember."""

    observation_spec = ObservationSpec(course_points=4)

    def __init__(self, pedal: float = 0.3) -> None:
        self._pedal = pedal

    def initial_memory(self, n: int) -> Batch:
        return np.zeros((n, 1), np.float32)

    def act(self, observations: Batch, memory: Batch) -> tuple[Batch, Batch]:
        actions = np.zeros((len(observations), 2), np.float32)
        actions[:, 0] = self._pedal + 0.3 * np.sin(memory[:, 0] / 7.0)
        return actions, memory + 1.0


def race(seed: int = 1) -> Match:
    """Five minutes of two cars."""
    scenario, ids = "endurance:hours=0.02,cars=2", ("one", "two")
    return Match("race", scenario, scenario, "lindenring", "gt3", ids, ids, (Race(seed, (Seat(0), Seat(1))),))


class Here(Pool):
    """Drives legs in this process, until it is stopped."""

    def __init__(self, legs: int) -> None:
        super().__init__(1)
        self.left = legs

    def drive_leg(self, match: Match, leg: Leg) -> LegDriven:
        if not self.left:
            raise KeyboardInterrupt
        self.left -= 1
        return drive_leg(match, [Counting(), Counting()], leg, Watch())


def test_a_race_that_was_stopped_ends_as_if_it_had_not_been(tmp_path: Path) -> None:
    whole = drive_race(Here(9), race(), tmp_path / "whole", leg_s=30.0)
    with pytest.raises(KeyboardInterrupt):
        drive_race(Here(1), race(), tmp_path / "stopped", leg_s=30.0)
    went_on = drive_race(Here(2), race(), tmp_path / "stopped", leg_s=30.0)
    assert went_on.results.equals(whole.results)
    assert went_on.laps.equals(whole.laps)
    # And as in a single run, for policies without random generators of their own.
    assert whole.results.equals(run_match(race(), [Counting(), Counting()]))
    assert whole.results["ending"].to_list() == ["time_up", "time_up"]
    # What is over is not driven again.
    assert drive_race(Here(0), race(), tmp_path / "stopped", leg_s=30.0).results.equals(whole.results)


def test_a_folder_goes_on_with_its_own_race_only(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        drive_race(Here(1), race(), tmp_path, leg_s=5.0)
    kept = tmp_path / "leg-01.npz"
    with refusal(kept, "is of a race with other entrants"):
        drive_race(Here(9), race(seed=2), tmp_path, leg_s=5.0)
    kept.write_bytes(b"PK\3\4 no more than this")
    with refusal(kept, "is no leg of a race"):
        drive_race(Here(9), race(), tmp_path, leg_s=5.0)


def wall(wear: float, fuel_kg: float, lap: int = 3, laps: int | None = None, film_mm: float = 0.0) -> PitWall:
    """What the only car's strategist knows, on racing-medium."""
    one = np.zeros(1, int)
    return PitWall(
        car=0,
        laps=laps,
        lap=lap,
        ends_lap=lap + 1,
        wear=np.array([wear, 0.0, 0.0, 0.0]),
        fuel_kg=fuel_kg,
        last_lap_s=np.array([100.0]),
        gap_s=np.zeros(1),
        compounds=("racing-medium",),
        laps_done=one,
        stops=one,
        pit=rule_parameters(load_rules("sporting")).pit,
        tank_kg=80.0,
        penalty_s=np.zeros(1),
        film_mm=film_mm,
        forecast=(Weather(),) if film_mm else (),
    )


def test_who_has_no_plan_stops_when_tyres_are_worn_or_fuel_is_short() -> None:
    strategist = WhenNeeded(load_car("gt3"), "racing-medium", 1.0)
    assert strategist.decide(wall(0.5, 40.0)) is None
    assert strategist.decide(wall(0.9, 40.0)) == Service("racing-medium", 80.0)
    assert strategist.decide(wall(0.1, 4.0)) == Service(None, 80.0)
    # Two laps at full power burn some 6 kg; in the last one 4 will do, and tyres last.
    assert strategist.decide(wall(0.9, 4.0, lap=9, laps=10)) is None


def test_who_has_no_plan_stops_for_tyres_that_suit_the_road() -> None:
    strategist = WhenNeeded(load_car("gt3"), "racing-medium", 1.0)
    assert strategist.decide(wall(0.1, 40.0, film_mm=0.05)) is None
    assert strategist.decide(wall(0.1, 40.0, film_mm=0.25)) == Service("intermediate", 80.0)
    assert strategist.start(wall(0.0, 80.0, film_mm=1.0)) == Service("wet")


def laps() -> pl.DataFrame:
    rows = [
        (0, 1, 100.0, None, 0, "racing-soft", 0.1, 70.0, 0, 0),
        (1, 1, 101.0, None, 0, "racing-hard", 0.1, 70.0, 0, 0),
        (0, 2, 230.0, 130.0, 1, "racing-hard", 0.0, 70.0, 0, 0),
        (1, 2, 201.0, 100.0, 0, "racing-hard", 0.2, 60.0, 0, 0),
        (1, 3, 301.0, 100.0, 0, "racing-hard", 0.3, 50.0, 0, 0),
    ]
    return pl.DataFrame(rows, schema=LAP_CHART, orient="row")


def test_places_are_those_when_the_leader_completes_a_lap() -> None:
    order = running_order(laps())
    assert order.filter(car=1).sort("lap")["place"].to_list() == [2, 1, 1]
    assert stints(laps()).select("car", "stint", "compound", "first", "last").rows() == [
        (0, 1, "racing-soft", 1, 1),
        (0, 2, "racing-hard", 2, 2),
        (1, 1, "racing-hard", 1, 3),
    ]


def placed(rows: list[tuple[int, str, str, int, float]]) -> pl.DataFrame:
    """Results of a race, by place in class."""
    columns = ("slot", "name", "class", "class_place", "points")
    return pl.DataFrame(rows, columns, orient="row").with_columns(place=pl.col("class_place"))


def test_wins_decide_between_equal_points() -> None:
    first = [(1, "a", "gt3", 2, 8.0), (2, "b", "gt3", 1, 10.0), (3, "c", "gt3", 3, 6.0)]
    second = [(1, "b", "gt3", 4, 5.0), (2, "a", "gt3", 3, 7.0), (3, "c", "gt3", 1, 10.0)]
    table = season_table({"x": placed(first), "y": placed(second)})
    assert table.rows() == [
        ("gt3", 1, "c", 16.0, 1, 6.0, 10.0),
        ("gt3", 2, "b", 15.0, 1, 10.0, 5.0),
        ("gt3", 3, "a", 15.0, 0, 8.0, 7.0),
    ]


def test_each_class_of_a_season_has_places_of_its_own() -> None:
    raced = [(1, "a", "gt3", 1, 10.0), (2, "b", "prototype", 1, 10.0), (3, "c", "gt3", 2, 8.0)]
    table = season_table({"x": placed(raced)})
    assert table.rows() == [
        ("gt3", 1, "a", 10.0, 1, 10.0),
        ("gt3", 2, "c", 8.0, 0, 8.0),
        ("prototype", 1, "b", 10.0, 1, 10.0),
    ]


def test_a_season_has_weekends_and_a_table(tmp_path: Path) -> None:
    """Of two who never come round; a second call finds all that was driven, and practises what was not."""
    entrants = {"one": Counting(0.3), "two": Counting(0.4)}

    def run() -> nathlon.SeasonResult:
        return nathlon.season(entrants, circuits=["porto-sereno"], laps=1, out=tmp_path, progress=False)

    result = run()
    practised = tmp_path / "1-porto-sereno" / "practice.csv"
    practised.write_text("".join(practised.read_text("utf-8").splitlines(keepends=True)[:2]), "utf-8")
    again = run()
    assert result.table["points"].to_list() == [10.0, 8.0] == result.table["porto-sereno"].to_list()
    [weekend] = result.weekends
    assert weekend.qualifying["lap_s"].to_list() == [None, None]
    assert weekend.practice is not None
    assert weekend.practice["plan"].to_list() == [None, None]
    assert weekend.results["stops"].to_list() == [0, 0]
    assert again.weekends[0].results.equals(weekend.results)
    assert pl.read_csv(practised)["name"].to_list() == ["one", "two"]
    written = {path.name for path in weekend.folder.iterdir()}
    assert {"index.html", "laps.csv", "legs", "practice.csv", "results.csv"} <= written
    page = result.page.read_text("utf-8")
    assert "nobody has completed one" in page
    assert '<a href="1-porto-sereno/index.html">porto-sereno</a>' in page
    assert weekend.page == tmp_path / "1-porto-sereno" / "index.html"


def test_a_circuit_of_a_file_is_called_as_its_folder() -> None:
    names = ["lindenring", "made/street-7", "made/street-7/circuit.toml", "made/oval.toml"]
    assert list(map(events._short, names)) == ["lindenring", "street-7", "street-7", "oval"]


def test_a_circuit_is_raced_once_a_season() -> None:
    with pytest.raises(InputError, match="expected one or more, each once"):
        nathlon.season("driver", circuits=["lindenring", "lindenring"])


def test_a_table_of_an_event_has_no_empty_columns() -> None:
    rows = [["1", "a", "", "time up"], ["2", "b", "", "time up"]]
    shown = table_chapter("Race", rows, ("Place", "Entrant", "Time", "Ending"))
    assert shown.heads == ["Place", "Entrant", "Ending"]
    assert shown.rows == [["1", "a", "time up"], ["2", "b", "time up"]]
    assert table_chapter("Race", [], ("Place", "Time")).heads == ["Place", "Time"]
    some = table_chapter("Race", [["1", ""], ["2", "61.0"]], ("Place", "Time"))
    assert some.heads == ["Place", "Time"]


@pytest.mark.parametrize(
    "kept",
    [b"name,plan,expected_s\none,,\n", b"", b"\xff\xfe\n", b"name,plan,expected_s,reason\na,b,soon,\n"],
)
def test_practice_of_another_form_is_refused(kept: bytes, tmp_path: Path) -> None:
    path = tmp_path / "practice.csv"
    path.write_bytes(kept)
    with pytest.raises(InputError, match=r"practice\.csv: expected a table with the columns name, plan"):
        events._practised(path)


def test_practice_says_what_was_expected_and_came_or_why_there_is_no_plan() -> None:
    practice = pl.DataFrame(
        {
            "name": ["one", "two", "three"],
            "plan": ["planner.toml", None, None],
            "expected_s": [500.0, None, None],
            "reason": [None, "9 practice laps", None],
        }
    )
    results = pl.DataFrame({"name": ["three", "one", "two"], "race_time_s": [498.0, 501.5, None]})
    shown = practice_chapter(practice, results)
    assert shown.rows == [
        ["one", "from practice", "500.000", "501.500"],
        ["two", "none: 9 practice laps", "", ""],
        ["three", "", "", "498.000"],
    ]


def test_the_page_of_an_event_shows_its_laps(tmp_path: Path) -> None:
    names = pl.when(pl.col("car") == 0).then(pl.lit("<first>")).otherwise(pl.lit("second"))
    chapters = [
        table_chapter("Race", [["1", "<first>"]], ("Place", "Entrant")),
        lap_chapter(laps().with_columns(name=names, **{"class": pl.lit("gt3")}), "Laps"),
    ]
    text = write_event_page(tmp_path, "second wins", "a race", chapters).read_text("utf-8")
    assert "&lt;first&gt;" in text
    assert "data:image/png;base64," in text
