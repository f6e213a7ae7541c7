"""Events with cars of several classes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

import nathlon
from nathlon.api.candidates import with_cars
from nathlon.arena.entrance import enter_in_cars
from nathlon.arena.entrant import Entrant, only_once
from nathlon.arena.lap_chart import LAP_CHART
from nathlon.arena.match import Match
from nathlon.arena.pool import Pool
from nathlon.arena.results import RESULTS
from nathlon.arena.single_race import single_race
from nathlon.lab.events.chapters import stint_chapter
from nathlon.lab.events.classes import class_names, grid_by_class
from nathlon.lab.events.race_folder import RaceDriven
from nathlon.lab.events.standings import Started, class_leaders, with_names
from nathlon.policies.bundled import champion
from nathlon.sim.errors import InputError
from tests.nathlon.test_events import Counting


def entrant(source: str, car: str) -> Entrant:
    return Entrant(source, source, source, "built-in driver", "lindenring", car, None, None)


def driven(places: list[int]) -> RaceDriven:
    """A race of cars from pole that came to these places."""
    cars = pl.DataFrame({"car": range(len(places)), "place": places, "points": 0.0})
    results = pl.concat([pl.DataFrame(schema=RESULTS), cars], how="diagonal_relaxed")
    return RaceDriven(results, pl.DataFrame(schema=LAP_CHART))


def test_places_and_points_are_counted_in_each_class() -> None:
    grid = [Started("a", "gt3"), Started("b", "prototype"), Started("c", "gt3"), Started("d", "prototype")]
    results, _ = with_names(driven([3, 1, 2, 4]), grid)
    assert results.select("name", "class", "place", "class_place", "points").rows() == [
        ("b", "prototype", 1, 1, 10.0),
        ("c", "gt3", 2, 1, 10.0),
        ("a", "gt3", 3, 2, 8.0),
        ("d", "prototype", 4, 2, 8.0),
    ]
    assert class_leaders(results) == {"prototype": "b", "gt3": "c"}


def test_several_cars_of_an_entrant_are_told_apart() -> None:
    results, _ = with_names(
        driven([1, 2, 3]), [Started("a", "gt3"), Started("b", "gt3"), Started("a", "gt3")]
    )
    assert results["name"].to_list() == ["a #1", "b #2", "a #3"]


def test_the_fastest_class_starts_in_front() -> None:
    entered = [entrant("a", "gt3"), entrant("b", "prototype"), entrant("c", "coupe")]
    assert grid_by_class(entered, 6) == [1, 1, 0, 0, 2, 2]
    assert grid_by_class([replace(one, car="gt3") for one in entered], 5) == [0, 1, 2, 0, 1]


def test_classes_are_called_after_their_files() -> None:
    assert class_names(["gt3", "my/fast.toml"]) == {"gt3": "gt3", "my/fast.toml": "fast"}
    assert class_names(["a/x.toml", "b/x.toml"]) == {"a/x.toml": "a/x.toml", "b/x.toml": "b/x.toml"}


def test_the_cars_of_a_match_decide_its_outcome_and_one_car_is_as_it_was() -> None:
    entered = [entrant("driver", "prototype"), entrant("driver:pace=0.9", "gt3")]
    scenario = "endurance:cars=2"
    match = single_race(entered, scenario, seed=1)
    assert match.cars == match.classes == ("prototype", "gt3")
    assert Match.from_spec(match.spec(), {}).key == match.key
    assert replace(match, classes=("prototype", "coupe")).key != match.key
    alike = single_race([replace(one, car="gt3") for one in entered], scenario, seed=1)
    assert alike.classes == ()
    assert not {"classes", "class_facts"} & alike.spec().keys()


def test_a_policy_may_drive_in_two_classes() -> None:
    both = only_once([entrant("driver", "gt3"), entrant("driver", "prototype"), entrant("driver", "gt3")])
    assert [one.name for one in both] == ["driver gt3", "driver prototype"]


def test_each_candidate_may_name_its_car() -> None:
    pairs = with_cars(["driver?car=prototype", "driver:pace=0.9"], "gt3")
    assert pairs == [("driver", "prototype"), ("driver:pace=0.9", "gt3")]
    [(source, car)] = with_cars({"fast?car=coupe": Counting()}, "gt3")
    assert (source.partition("#")[0], car) == ("object:fast", "coupe")


def test_an_unknown_car_is_refused_before_anything_is_opened() -> None:
    with pytest.raises(
        InputError, match=r"^driver\?car=boat: car 'boat' is unknown; expected one of coupe, gt3"
    ):
        nathlon.endurance(["driver", "driver?car=boat"])


def test_a_policy_that_does_not_fit_its_car_is_refused(pool: Pool) -> None:
    made_for_gt3 = str(champion("lindenring", "gt3"))
    with pytest.raises(InputError, match="car is 'gt3', expected 'prototype'"):
        enter_in_cars(pool, [(made_for_gt3, "prototype")], "lindenring")


def test_stints_are_told_in_the_order_of_the_grid_with_their_class() -> None:
    facts = {"stops": [0, 0], "compound": ["racing-hard"] * 2, "lap": [1, 1], "lap_s": [90.0, 100.0]}
    laps = pl.DataFrame(facts | {"car": [1, 0], "name": ["a", "b"], "class": ["gt3", "prototype"]})
    chapter = stint_chapter(laps)
    assert chapter.heads[:2] == ["Entrant", "Class"]
    assert [row[:2] for row in chapter.rows] == [["b", "prototype"], ["a", "gt3"]]
    assert "Class" not in stint_chapter(laps.with_columns(pl.lit("gt3").alias("class"))).heads


def test_an_endurance_of_two_classes(tmp_path: Path) -> None:
    entrants = {"here": Counting(0.3), "there?car=prototype": Counting(0.3)}
    result = nathlon.endurance(
        entrants, hours=1 / 60, cars=4, scenario="endurance:rules=blue_flags", out=tmp_path, progress=False
    )
    assert result.results.sort("slot")["class"].to_list() == ["prototype", "prototype", "gt3", "gt3"]
    assert sorted(result.results["class_place"]) == [1, 1, 2, 2]
    assert result.results["ending"].unique().to_list() == ["time_up"]
    distance = result.results.group_by("class").agg(pl.col("distance_m").max()).sort("class")["distance_m"]
    assert distance[1] > distance[0] + 100.0
    page = result.page.read_text("utf-8")
    assert "In class" in page
    assert "is the first of gt3" in page
