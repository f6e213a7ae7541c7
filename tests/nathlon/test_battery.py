"""The skill battery: points by test, their sum and ties."""

import numpy as np
import polars as pl
import pytest

from nathlon.arena.results import BATTERY, SKILLS
from nathlon.selection.battery.ranking import MARKS, rank_battery, skills


def seeded() -> np.random.Generator:
    return np.random.default_rng(8)


def measured(points: dict[tuple[str, str], list[float]]) -> pl.DataFrame:
    """MARKS with the given points of each run; the measure is 100 s less a tenth of the points."""
    table = [
        (entrant, test, run, 100 - value / 10, "s", float(value))
        for (entrant, test), values in points.items()
        for run, value in enumerate(values)
    ]
    return pl.DataFrame(table, schema=MARKS, orient="row")


def simulated(levels: dict[str, float], runs: int, rng: np.random.Generator) -> pl.DataFrame:
    """Three tests in which an entrant scores its level, 500 and 600 on average."""
    return measured(
        {
            (entrant, test): list(rng.normal(mean, spread, runs))
            for entrant, level in levels.items()
            for test, mean, spread in (("lap", level, 30), ("pass", 500, 80), ("start", 600, 50))
        }
    )


def test_means_and_their_sum() -> None:
    marks = measured({("a", "lap"): [400, 600], ("a", "pass"): [100, 100], ("b", "lap"): [800, 900]})
    table = skills(marks, seeded())
    assert table.schema == SKILLS
    assert table.select("entrant", "test", "measure", "unit", "points", "runs").rows() == [
        ("a", "lap", 50.0, "s", 500.0, 2),
        ("a", "pass", 90.0, "s", 100.0, 2),
        ("b", "lap", 15.0, "s", 850.0, 2),
    ]
    ranking = rank_battery(marks, seeded())
    assert ranking.schema == BATTERY
    assert ranking.select("entrant", "points", "shortlisted").rows() == [
        ("b", 850.0, False),
        ("a", 600.0, False),
    ]


def test_a_run_without_a_mark_scores_but_does_not_spoil_the_mean_measure() -> None:
    marks = measured({("a", "lap"): [400, 600, 0]}).with_columns(
        measure=pl.when(pl.col("points") > 0).then("measure")
    )
    row = skills(marks, seeded()).row(0, named=True)
    assert (row["measure"], row["points"], row["runs"]) == (50.0, pytest.approx(1000 / 3), 3)


def test_the_intervals_cover_the_true_points() -> None:
    rng = seeded()
    sums, tests = [], []
    for _ in range(6):  # 1800 intervals: a standard error of 0.5 %
        marks = simulated({str(entrant): 700.0 for entrant in range(300)}, 5, rng)
        ranking = rank_battery(marks, rng, resamples=300)
        sums += [low <= 1800 <= high for low, high in ranking.select("points_low", "points_high").iter_rows()]
        passes = skills(marks, rng, resamples=300).filter(pl.col("test") == "pass")
        tests += [low <= 500 <= high for low, high in passes.select("points_low", "points_high").iter_rows()]
    assert 0.93 <= np.mean(sums) <= 0.97
    assert 0.93 <= np.mean(tests) <= 0.97


def test_equals_are_told_apart_in_no_more_than_one_battery_of_twenty() -> None:
    rng = seeded()
    apart = [
        rank_battery(simulated(dict.fromkeys("abcdef", 700.0), 6, rng), rng, resamples=20)["rank"].max() != 1
        for _ in range(200)
    ]
    assert np.mean(apart) <= 0.05 + 3 * 0.0154  # standard errors


def test_a_planted_order_is_recovered_and_close_entrants_share_a_rank() -> None:
    ranking = rank_battery(simulated({"slow": 300, "fast": 900, "twin": 900}, 12, seeded()), seeded())
    ranks = dict(ranking.select("entrant", "rank").iter_rows())
    assert ranks == {"fast": 1, "twin": 1, "slow": 3}


def test_equal_points_are_ordered_by_entrant_id() -> None:
    marks = measured({(entrant, "lap"): [500, 500] for entrant in "cabd"})
    ranking = rank_battery(marks, seeded())
    assert ranking["entrant"].to_list() == ["a", "b", "c", "d"]
    assert ranking["rank"].to_list() == [1, 1, 1, 1]
    assert ranking["points_low"].to_list() == [500.0] * 4


def test_single_runs_give_no_interval_and_a_tie() -> None:
    marks = measured({("a", "lap"): [100], ("b", "lap"): [900]})
    ranking = rank_battery(marks, seeded())
    assert ranking["rank"].to_list() == [1, 1]
    assert ranking["points_low"].null_count() == 2
    assert skills(marks, seeded())["points_high"].null_count() == 2


def test_no_marks_at_all() -> None:
    empty = pl.DataFrame(schema=MARKS)
    assert skills(empty, seeded()).schema == SKILLS
    assert rank_battery(empty, seeded()).schema == BATTERY


def test_same_seed_gives_the_same_bytes_and_the_order_of_rows_does_not_matter() -> None:
    marks = simulated({"a": 500, "b": 600, "c": 700}, 6, seeded())
    shuffled = marks.sample(fraction=1.0, shuffle=True, seed=2)
    for first, again in ((marks, marks), (marks, shuffled)):
        assert skills(first, seeded()).write_csv() == skills(again, seeded()).write_csv()
        ranked = rank_battery(first, seeded()).write_csv()
        assert ranked == rank_battery(again, seeded()).write_csv()
