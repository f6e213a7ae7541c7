"""Free-for-alls: what the points say where everybody races for themselves, eight or more or fewer."""

from __future__ import annotations

import itertools

import numpy as np
import polars as pl
import pytest

from nathlon.arena.classification import PLACE_POINTS
from nathlon.arena.statistics import interval, spread
from nathlon.tournament.evidence import Evidence
from nathlon.tournament.formats import FORMATS
from nathlon.tournament.points import EQUAL, better, matchups, rank
from nathlon.tournament.ratings import rate
from tests.support.race_results import rows


def seeded() -> np.random.Generator:
    return np.random.default_rng(11)


def free_for_all(pace: dict[str, float], blocks: int, rng: np.random.Generator) -> pl.DataFrame:
    """Blocks of races of all against all; luck lasts for a block."""
    names, grids = np.array(list(pace)), FORMATS["ffa8"].grids(len(pace))
    shape = (blocks, len(grids), 8)
    block, race, car = np.indices(shape)
    side = np.array([grid.sides for grid in grids])[race, car]
    luck = rng.standard_normal((blocks, len(pace)))[block, side]
    score = np.array(list(pace.values()))[side] + luck - 0.25 * car + rng.standard_normal(shape)
    place = 1 + np.argsort(np.argsort(-score, axis=-1), axis=-1)
    columns = {
        "race": block * len(grids) + race,
        "mirrored": np.array([grid.mirrored for grid in grids])[race],
        "car": car,
        "slot": car + 1,
        "entrant": names[side],
        "place": place,
        "points": np.array(PLACE_POINTS, dtype=float)[place - 1],
    }
    return rows({name: value.ravel() for name, value in columns.items()}, car.size)


@pytest.mark.parametrize("entrants", [3, 5, 12])
def test_a_free_for_all_of_more_or_fewer_than_eight_scores_what_its_cars_do(entrants: int) -> None:
    """Eight starts in a unit of as many races as entrants: points of all one's cars, a race of the unit."""
    pace = {letter: 0.5 * index for index, letter in enumerate("abcdefghijkl"[:entrants])}
    results = free_for_all(pace, 20, seeded())
    ranking = rank(results, seeded())
    own = results.group_by("entrant").agg(pl.col("points").sum(), pl.col("race").n_unique())
    for entrant, points, races in own.iter_rows():
        row = ranking.row(by_predicate=pl.col("entrant") == entrant, named=True)
        assert row["points_per_race"] == pytest.approx(points / (20 * entrants))
        assert (row["pairs"], row["races"]) == (20, races)
    assert results.group_by("entrant").len()["len"].unique().to_list() == [160]
    assert ranking["entrant"][0] == max(pace, key=pace.__getitem__)
    assert ranking["rank"][0] == 1 < ranking["rank"][-1]


def test_a_free_for_all_scores_mean_points_and_resamples_blocks() -> None:
    """With blocks of eight races the scores are plain means, their intervals those of block means."""
    pace = {letter: 0.3 * index for index, letter in enumerate("abcdefgh")}
    results = free_for_all(pace, 6, seeded())
    ranking = rank(results, seeded(), resamples=20_000)
    blocks = results.group_by("entrant", pl.col("race") // 8, maintain_order=True).agg(
        pl.col("points").mean()
    )
    for row in ranking.iter_rows(named=True):
        mine = blocks.filter(pl.col("entrant") == row["entrant"])["points"].to_numpy()
        assert row["points_per_race"] == pytest.approx(mine.mean())
        low, high = interval(
            np.array([mine.mean()]), np.eye(1), spread(mine, np.array([6]), 20_000, seeded()), 0.95
        )
        assert (row["points_low"], row["points_high"]) == pytest.approx((low[0], high[0]), abs=0.15)
        assert (row["pairs"], row["races"]) == (6, 48)
    assert ranking["points_per_race"].mean() == pytest.approx(sum(PLACE_POINTS) / 8)
    table = matchups(results, seeded())
    assert table.height == 56
    assert set(table["pairs"]) == {6}


def test_in_a_free_for_all_equals_are_seldom_told_apart() -> None:
    """Though its 28 differences of a block are not independent, and luck lasts for a block."""
    rng = seeded()
    equal = dict.fromkeys("abcdefgh", 0.0)
    false = sum(better(Evidence(free_for_all(equal, 5, rng), EQUAL), 0.05).any() for _ in range(80))
    assert false / 80 <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / 80)


def test_a_block_that_lacks_a_race_is_set_aside() -> None:
    results = free_for_all(dict.fromkeys("abcdefgh", 0.0), 4, seeded())
    assert set(rank(results.filter(pl.col("race") != 9), seeded())["pairs"]) == {3}


def table(race: int, *places: str) -> pl.DataFrame:
    """A race of those named, the first first, with points as in a world of three seats."""
    cars = range(len(places))
    points = [float(PLACE_POINTS[car]) for car in cars]
    columns = {"race": race, "car": cars, "entrant": places, "place": [car + 1 for car in cars]}
    return rows({**columns, "points": points}, len(places))


def test_two_are_compared_in_the_races_that_both_took_part_in() -> None:
    """b beats a whenever they meet, but a rests where the strong race, and has more points in all."""
    unit = [("b", "a", "c"), ("a", "c", "d"), ("d", "e", "b"), ("d", "e", "c"), ("e", "a", "b")]
    results = pl.concat(table(5 * block + race, *unit[race]) for block in range(4) for race in range(5))
    overall = results.group_by("entrant").agg(pl.col("points").sum())
    assert dict(overall.iter_rows())["a"] > dict(overall.iter_rows())["b"]
    told = matchups(results, seeded())
    row = told.row(by_predicate=(pl.col("entrant") == "a") & (pl.col("opponent") == "b"), named=True)
    assert row["difference"] == pytest.approx((8 - 10 + 8 - 6) / 2)
    assert (row["points_per_race"], row["pairs"]) == (8.0, 4)
    met = {frozenset(two) for two in told.select("entrant", "opponent").iter_rows()}
    together = {frozenset(two) for race in unit for two in itertools.combinations(race, 2)}
    assert met == together, "who never met is in no matchup"


def test_who_shares_all_places_is_rated_alike() -> None:
    """Whichever of them has the first seat."""
    races = [table(race, *"abc") for race in range(12)]
    tied = pl.concat(races).with_columns(place=pl.when(pl.col("entrant") == "c").then(3).otherwise(1))
    strengths = dict(rate(tied).select("entrant", "plackett_luce").iter_rows())
    assert strengths["a"] == pytest.approx(strengths["b"], abs=1e-6)
    assert strengths["a"] > strengths["c"]
