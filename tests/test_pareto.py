"""The Pareto filter on known fronts and under noise."""

import moocore
import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from polars.testing import assert_frame_equal

from arena.results import PARETO, RESULTS
from nathlon.pareto import pareto
from tests.race_results import rows


def seeded() -> np.random.Generator:
    return np.random.default_rng(4)


def field(lap: np.ndarray, off_course: np.ndarray, contacts: np.ndarray) -> pl.DataFrame:
    """Results of E entrants in R races each, from (E, R) laps in s, off-course times in s and contacts."""
    entrant, race = np.indices(lap.shape)
    return rows(
        {
            "stage": "pareto",
            "match": np.char.mod("match %05d", entrant).ravel(),
            "entrant": np.char.mod("entrant %05d", entrant).ravel(),
            "race": race.ravel(),
            "best_lap_s": [None if np.isnan(value) else float(value) for value in lap.ravel()],
            "off_course_s": off_course.ravel(),
            "contacts": contacts.ravel(),
        },
        lap.size,
    )


def repeated(points: list[tuple[float, float, int]], races: int = 3) -> pl.DataFrame:
    """Every entrant does the same in each of its races: no noise."""
    lap, off_course, contacts = (np.repeat([column], races, axis=0).T for column in zip(*points, strict=True))
    return field(lap, off_course, contacts)


def test_a_known_front_with_a_duplicate_and_a_tie() -> None:
    table = pareto(
        repeated([(90, 9, 0), (91, 3, 1), (91, 3, 1), (92, 3, 1), (93, 0, 5), (94, 9, 5), (90, 9, 1)]),
        seeded(),
    )
    assert table.schema == PARETO
    assert table["survives"].to_list() == [True, True, True, False, True, False, False]
    assert table["nondominated_probability"].to_list() == [1, 1, 1, 0, 1, 0, 0]
    assert table["races"].to_list() == [3] * 7


def test_objectives_are_a_mean_and_two_rates_of_sums() -> None:
    results = field(np.array([[90.0, 94.0]]), np.array([[3.0, 0.0]]), np.array([[1, 4]])).with_columns(
        driven_s=pl.Series([100.0, 50.0]), distance_m=pl.Series([3000.0, 1000.0])
    )
    row = pareto(results, seeded()).row(0, named=True)
    assert (row["lap_s"], row["off_course_share"], row["contacts_per_km"]) == pytest.approx((92, 0.02, 1.25))


@settings(max_examples=50, deadline=None)
@given(
    points=st.lists(
        st.tuples(st.integers(80, 84), st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=12
    )
)
def test_without_noise_it_is_the_brute_force_front(points: list[tuple[int, int, int]]) -> None:
    table = pareto(
        repeated([(float(lap), float(off), hits) for lap, off, hits in points]), seeded(), resamples=5
    )
    dominated = [
        any(all(a <= b for a, b in zip(other, point, strict=True)) and other != point for other in points)
        for point in points
    ]
    assert table["survives"].to_list() == [not value for value in dominated]


def test_without_a_lap_one_neither_survives_nor_dominates() -> None:
    nan = np.nan
    lap = np.array([[95.0, 96.0], [nan, nan], [90.0, nan]])
    table = pareto(
        field(lap, np.array([[9, 9], [0, 0], [9, 9]]), np.array([[2, 2], [0, 0], [2, 2]])), seeded()
    )
    assert table["survives"].to_list() == [True, False, True]
    assert table["lap_s"].to_list() == [95.5, None, 93.0]  # the missing lap counts as the slowest, 96 s
    assert table["nondominated_probability"][1] == 0
    nobody = pareto(field(np.full((2, 2), nan), np.zeros((2, 2)), np.zeros((2, 2), int)), seeded())
    assert nobody["survives"].to_list() == [False, False]


def test_a_lap_of_a_race_that_the_policy_failed_counts_as_missing() -> None:
    results = field(np.array([[90.0, 80.0], [96.0, 96.0]]), np.zeros((2, 2)), np.zeros((2, 2), int))
    failed = results.with_columns(
        ending=pl.when(pl.col("best_lap_s") == 80).then(pl.lit("policy_raised")).otherwise("ending")
    )
    assert pareto(failed, seeded())["lap_s"].to_list() == [93.0, 96.0]


def test_a_race_with_a_simulator_fault_is_void_and_still_shown() -> None:
    results = field(np.array([[90.0, 99.0], [95.0, 95.0]]), np.zeros((2, 2)), np.zeros((2, 2), int))
    void = results.with_columns(
        ending=pl.when(pl.col("best_lap_s") == 99).then(pl.lit("simulator_fault")).otherwise("ending")
    )
    assert pareto(void, seeded())["lap_s"].to_list() == [90.0, 95.0]
    all_void = pareto(results.with_columns(ending=pl.lit("simulator_fault")), seeded())
    assert all_void["races"].to_list() == [0, 0]
    assert all_void["survives"].to_list() == [False, False]
    assert pareto(pl.DataFrame(schema=RESULTS), seeded()).schema == PARETO


def test_the_cars_of_an_entrant_in_a_race_are_taken_together_and_others_do_not_count() -> None:
    alone = field(np.array([[91.0, 93.0]]), np.array([[1.0, 2.0]]), np.array([[1, 2]]))
    second_car = alone.with_columns(car=pl.lit(1, pl.Int64), best_lap_s=pl.col("best_lap_s") + 2)
    row = pareto(pl.concat([alone, second_car]), seeded()).row(0, named=True)
    assert (row["lap_s"], row["races"]) == (93.0, 2)


def test_the_rule_keeps_more_of_the_true_front_than_the_observed_front() -> None:
    rng = seeded()
    entrants, races = 400, 4
    lap = 100 + rng.gamma(2.0, 1.5, (entrants, 1))
    off_course = rng.gamma(1.0, 6.0, (entrants, 1)) + 0.3
    contacts = rng.gamma(1.0, 3.0, (entrants, 1)) + 0.1
    true_front = moocore.is_nondominated(np.hstack([lap, off_course, contacts]), keep_weakly=True)
    shape = (entrants, races)
    results = field(
        rng.normal(lap, 0.5, shape),
        rng.gamma(4.0, off_course / 4, shape),
        rng.poisson(np.broadcast_to(contacts, shape)),
    )
    table = pareto(results, seeded())
    observed = moocore.is_nondominated(
        table.select("lap_s", "off_course_share", "contacts_per_km").to_numpy(), keep_weakly=True
    )
    survives = table["survives"].to_numpy()
    assert survives[true_front].mean() > observed[true_front].mean() + 0.2
    assert survives.mean() < 0.25


def test_same_seed_gives_the_same_bytes_and_the_order_of_rows_does_not_matter() -> None:
    rng = seeded()
    results = field(rng.normal(95, 2, (30, 4)), rng.gamma(1, 3, (30, 4)), rng.poisson(2, (30, 4)))
    table = pareto(results, seeded())
    assert table.write_csv() == pareto(results, seeded()).write_csv()
    assert_frame_equal(
        table, pareto(results.sample(fraction=1.0, shuffle=True, seed=1), seeded()), check_exact=True
    )
