"""The Pareto filter on known fronts and under noise."""

import moocore
import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from polars.testing import assert_frame_equal

from nathlon.arena.match import NO_TEAM, TESTED
from nathlon.arena.results import OBJECTIVES, PARETO, RESULTS
from nathlon.selection.pareto import (
    SPREADS,
    STANDARD,
    draw,
    draw_means,
    in_contention,
    lost_remark,
    nondominated_probability,
    pareto,
)
from nathlon.selection.pareto.objective import (
    CONTACTS,
    Measured,
    Objective,
    measure,
    objectives_table,
    own_runs,
)
from tests.support.race_results import rows

PLACE = Objective(name="place", measure="place", source="race")
POINTS = Objective(name="points", measure="points", source="race", goal="max")


def seeded() -> np.random.Generator:
    return np.random.default_rng(4)


def drives(test: str, columns: dict[str, NDArray], shape: tuple[int, int]) -> pl.DataFrame:
    """RESULTS of a test: E entrants in R runs each, from columns (E, R)."""
    entrant, race = np.indices(shape)
    plain = {
        "stage": "pareto",
        "test": test,
        "match": np.char.mod(f"{test} %05d", entrant).ravel(),
        "entrant": np.char.mod("entrant %05d", entrant).ravel(),
        "race": race.ravel(),
        "team": TESTED,
    }
    return rows(plain | {name: column.ravel() for name, column in columns.items()}, entrant.size)


def field(lap: NDArray, off_course: NDArray, contacts: NDArray) -> pl.DataFrame:
    """Results of E entrants in R time trials and races, from (E, R) laps in s (NaN for none), off-course
    times in s and contacts."""
    completed = np.isfinite(lap)
    trials = drives(
        "time_trial",
        {
            "best_lap_s": lap,
            "laps": completed.astype(int),
            "ending": np.where(completed, "finished", "stuck"),
        },
        lap.shape,
    ).with_columns(pl.col("best_lap_s").fill_nan(None))
    races = drives("race", {"off_course_s": off_course, "contacts": contacts}, off_course.shape)
    return pl.concat([trials, races])


def repeated(points: list[tuple[float, float, int]], runs: int = 3) -> pl.DataFrame:
    """Every entrant does the same in each of its runs: no noise."""
    return field(*(np.repeat([column], runs, axis=0).T for column in zip(*points, strict=True)))


def planted(rng: np.random.Generator, entrants: int, runs: int) -> tuple[NDArray[np.bool_], pl.DataFrame]:
    """The true front of a simulated field, and its results."""
    lap = 100 + rng.gamma(2.0, 1.5, (entrants, 1))
    off_course = rng.gamma(1.0, 6.0, (entrants, 1)) + 0.3
    contacts = rng.gamma(1.0, 3.0, (entrants, 1)) + 0.1
    shape = (entrants, runs)
    results = field(
        rng.normal(lap, 0.5, shape),
        rng.gamma(4.0, off_course / 4, shape),
        rng.poisson(np.broadcast_to(contacts, shape)),
    )
    return moocore.is_nondominated(np.hstack([lap, off_course, contacts]), keep_weakly=True), results


def observed_front(table: pl.DataFrame) -> NDArray[np.bool_]:
    """The front of the values as they were measured."""
    values = table.select("lap_s", "off_course_share", "contacts_per_km").to_numpy()
    return moocore.is_nondominated(values, keep_weakly=True)


def test_a_known_front_with_a_duplicate_and_a_tie() -> None:
    table = pareto(
        repeated([(90, 9, 0), (91, 3, 1), (91, 3, 1), (92, 3, 1), (93, 0, 5), (94, 9, 5), (90, 9, 1)]),
        STANDARD,
        seeded(),
    )
    assert table.schema == PARETO
    assert table["survives"].to_list() == [True, True, True, False, True, False, False]
    assert table["nondominated_probability"].to_list() == [1, 1, 1, 0, 1, 0, 0]
    assert table["races"].to_list() == [3] * 7


def test_objectives_are_a_mean_and_two_rates_of_sums() -> None:
    results = field(np.array([[90.0, 94.0]]), np.array([[3.0, 0.0]]), np.array([[1, 4]])).with_columns(
        driven_s=pl.Series([1.0, 1.0, 100.0, 50.0]), distance_m=pl.Series([1.0, 1.0, 3000.0, 1000.0])
    )
    row = pareto(results, STANDARD, seeded()).row(0, named=True)
    assert (row["lap_s"], row["off_course_share"], row["contacts_per_km"]) == pytest.approx((92, 0.02, 1.25))
    table = objectives_table(results, [*STANDARD, POINTS])
    assert table.schema == OBJECTIVES
    assert table["objective"].to_list() == ["lap_s", "off_course_share", "contacts_per_km", "points"]
    assert table["value"].to_list() == pytest.approx([92, 0.02, 1.25, 0])
    assert table["unit"].to_list() == ["s", "1", "1/km", "points"]
    assert table["runs"].to_list() == [2] * 4


def without_noise(values: list[int], runs: int) -> Measured:
    """An objective of entrants that do the same in every run."""
    costs = np.array(values, float)
    names = [f"entrant {index:02}" for index in range(len(values))]
    return Measured(names, costs, np.repeat(costs, runs), np.full(len(values), runs))


@settings(max_examples=50, deadline=None)
@given(points=st.lists(st.tuples(*[st.integers(0, 3)] * 4), min_size=1, max_size=12), runs=st.integers(1, 3))
def test_without_noise_it_is_the_brute_force_front(points: list[tuple[int, ...]], runs: int) -> None:
    measured = [without_noise(list(column), runs) for column in zip(*points, strict=True)]
    for objectives in (1, 3, 4):
        seen = [point[:objectives] for point in points]
        dominated = [
            any(all(a <= b for a, b in zip(other, point, strict=True)) and other != point for other in seen)
            for point in seen
        ]
        probability = nondominated_probability(measured[:objectives], 5, seeded())
        assert probability.tolist() == [1.0 - value for value in dominated]


@pytest.mark.parametrize("objectives", [[PLACE], [POINTS], [PLACE, POINTS]])
def test_one_objective_or_the_same_turned_round_gives_the_best(objectives: list[Objective]) -> None:
    place = np.repeat([[3, 2, 5, 2]], 2, axis=0).T
    results = drives("race", {"place": place, "points": 10.0 - place}, place.shape)
    survives = pareto(results, objectives, seeded())["survives"].to_list()
    assert survives == [False, True, False, True]


def test_entrants_that_their_runs_do_not_tell_apart_are_ordered_by_chance() -> None:
    lap = without_noise([90, 91], 4)
    luck = Measured(lap.entrants, np.zeros(2), np.array([-1.0, 1.0] * 4), lap.sizes)
    assert nondominated_probability([lap, luck], 2000, seeded()) == pytest.approx([1.0, 0.5], abs=0.04)


def test_an_order_that_luck_alone_could_have_made_still_counts_for_something() -> None:
    """Costs spread less than luck spreads them, so that an estimate of the spread between entrants is nil."""
    cost = np.linspace(-0.9, 0.9, 20)
    runs = (cost[:, None] + np.linspace(-1.5, 1.5, 4)).ravel()
    entrants = [f"entrant {index:02}" for index in range(20)]
    draws = draw(Measured(entrants, cost, runs, np.full(20, 4)), 4000, seeded())
    assert 0.58 < (draws[:, 0] < draws[:, -1]).mean() < 0.9


@pytest.mark.parametrize("entrants", [3, 12])
def test_draws_of_true_means_are_calibrated(entrants: int) -> None:
    """What is planted with the spread's prior ranks evenly among its draws, whatever the mean is."""
    rng = seeded()
    ranks = []
    for _ in range(1500):
        variance = rng.uniform(0.05, 2.0, entrants)
        true = 7.0 + rng.choice(SPREADS) * rng.standard_normal(entrants)
        seen = true + np.sqrt(variance) * rng.standard_normal(entrants)
        draws = draw_means(seen, variance, 39, rng)
        best, one = true.min(), true[0]
        ranks.append(((draws.min(axis=1) < best).mean(), (draws[:, 0] < one).mean()))
    for rank in np.transpose(ranks):
        assert np.quantile(rank, [0.1, 0.25, 0.5, 0.75, 0.9]) == pytest.approx(
            [0.1, 0.25, 0.5, 0.75, 0.9], abs=0.04
        )


def test_without_a_lap_one_neither_survives_nor_dominates() -> None:
    nan = np.nan
    lap = np.array([[95.0, 96.0], [nan, nan], [90.0, nan]])
    results = field(lap, np.array([[9, 9], [0, 0], [9, 9]]), np.array([[2, 2], [0, 0], [2, 2]]))
    table = pareto(results, STANDARD, seeded())
    assert table["survives"].to_list() == [True, False, True]
    assert table["lap_s"].to_list() == [95.5, None, 93.0]  # the missing lap counts as the slowest, 96 s
    assert table["nondominated_probability"][1] == 0
    nobody = field(np.full((2, 2), nan), np.zeros((2, 2)), np.zeros((2, 2), int))
    assert pareto(nobody, STANDARD, seeded())["survives"].to_list() == [False, False]


def test_who_never_raced_or_never_came_round_in_a_race_neither_survives_nor_dominates() -> None:
    results = field(np.array([[90.0], [95.0], [80.0]]), np.zeros((3, 1)), np.array([[0], [2], [0]]))
    race, first, last = (pl.col(name) == value for name, value in zip(
        ("test", "entrant", "entrant"), ("race", "entrant 00000", "entrant 00002"), strict=True
    ))  # fmt: skip
    parked = results.with_columns(
        ending=pl.when(race & first).then(pl.lit("stuck")).otherwise("ending"),
        laps=pl.when(race & first).then(0).otherwise("laps"),
    ).filter(~(race & last))
    table = pareto(parked, STANDARD, seeded())
    assert table["survives"].to_list() == [False, True, False]
    assert table["races"].to_list() == [1, 1, 0]
    assert table["contacts_per_km"].to_list() == [0.0, 0.2, None]


def test_a_lap_of_a_run_that_the_policy_failed_counts_as_missing() -> None:
    results = field(np.array([[90.0, 80.0], [96.0, 96.0]]), np.zeros((2, 2)), np.zeros((2, 2), int))
    failed = results.with_columns(
        ending=pl.when(pl.col("best_lap_s") == 80).then(pl.lit("policy_raised")).otherwise("ending")
    )
    assert pareto(failed, STANDARD, seeded())["lap_s"].to_list() == [93.0, 96.0]


def test_a_race_with_a_simulator_fault_is_void_and_still_shown() -> None:
    results = field(np.array([[90.0, 99.0], [95.0, 95.0]]), np.zeros((2, 2)), np.zeros((2, 2), int))
    void = results.with_columns(
        ending=pl.when(pl.col("best_lap_s") == 99).then(pl.lit("simulator_fault")).otherwise("ending")
    )
    assert pareto(void, STANDARD, seeded())["lap_s"].to_list() == [90.0, 95.0]
    all_void = pareto(results.with_columns(ending=pl.lit("simulator_fault")), STANDARD, seeded())
    assert all_void["races"].to_list() == [0, 0]
    assert all_void["survives"].to_list() == [False, False]
    assert pareto(pl.DataFrame(schema=RESULTS), STANDARD, seeded()).schema == PARETO
    assert objectives_table(pl.DataFrame(schema=RESULTS), STANDARD).schema == OBJECTIVES


def test_only_who_is_tested_counts_and_an_opponents_fault_of_the_simulator_voids_its_race() -> None:
    own = drives("race", {"contacts": np.array([[1, 3]])}, (1, 2))
    opponents = own.with_columns(
        team=pl.lit(NO_TEAM, pl.Int64), contacts=pl.lit(9, pl.Int64), car=pl.lit(6, pl.Int64)
    )
    assert measure(own_runs(pl.concat([own, opponents])), CONTACTS).cost.tolist() == [0.2]
    faulty = opponents.with_columns(
        ending=pl.when(pl.col("race") == 1).then(pl.lit("simulator_fault")).otherwise("ending")
    )
    assert measure(own_runs(pl.concat([own, faulty])), CONTACTS).cost.tolist() == [0.1]


def test_what_gave_no_value_counts_as_the_worst_of_the_field_whichever_way_is_better() -> None:
    nothing_driven = np.array([[10_000.0, 0.0], [10_000.0, 10_000.0]])
    results = drives("race", {"distance_m": nothing_driven, "contacts": np.array([[1, 0], [2, 8]])}, (2, 2))
    for goal in ("min", "max"):
        objective = CONTACTS.model_copy(update={"goal": goal})
        worst = 0.8 if goal == "min" else 0.1
        assert objectives_table(results, [objective])["value"].to_list() == pytest.approx(
            [(0.1 * 10 + worst) / 11, 0.5]
        )


@pytest.mark.parametrize(("runs", "kept"), [(2, 0.75), (16, 0.85)])
def test_far_more_of_the_true_front_survives_than_is_on_the_observed_front(runs: int, kept: float) -> None:
    shares = []
    for seed in range(3):
        front, results = planted(np.random.default_rng(seed), 600, runs)
        table = pareto(results, STANDARD, seeded(), resamples=200)
        survives = table["survives"].to_numpy()
        assert survives.mean() < 0.25
        shares.append((survives[front].mean(), observed_front(table)[front].mean()))
    ours, plain = np.mean(shares, axis=0)
    assert ours > kept
    assert ours > plain + 0.2


def test_one_run_borrows_the_spread_of_those_who_have_two() -> None:
    front, results = planted(seeded(), 600, 2)
    once = results.filter((pl.col("race") == 0) | (pl.col("entrant") < "entrant 00060"))
    survives = pareto(once, STANDARD, seeded(), resamples=200)["survives"].to_numpy()
    alone = pareto(results.filter(pl.col("race") == 0), STANDARD, seeded(), resamples=200)
    assert survives[front].mean() > 0.6
    assert alone["survives"].to_list() == observed_front(alone).tolist()  # nobody's spread is known


def test_probabilities_are_what_they_say() -> None:
    """Of entrants with probability p to be on the front, a share of about p is on it."""
    said, true = [], []
    for seed in range(6):
        front, results = planted(np.random.default_rng(seed), 300, 2)
        table = pareto(results, STANDARD, seeded(), resamples=200)
        said.append(table["nondominated_probability"].to_numpy())
        true.append(front)
    probability, on_front = np.concatenate(said), np.concatenate(true)
    for low, high in ((0.0, 0.05), (0.05, 0.2), (0.2, 0.5), (0.5, 1.01)):
        among = (low <= probability) & (probability < high)
        assert on_front[among].mean() == pytest.approx(probability[among].mean(), abs=0.15)


def test_those_never_on_the_front_are_left_out_without_a_difference() -> None:
    runs = own_runs(planted(seeded(), 60, 3)[1])
    measured = [measure(runs, objective) for objective in STANDARD]
    probability = nondominated_probability(measured, 50, seeded())
    rng = seeded()
    draws = np.stack([draw(objective, 50, rng) for objective in measured], axis=-1)
    fronts = [moocore.is_nondominated(np.ascontiguousarray(points), keep_weakly=True) for points in draws]
    assert probability.tolist() == np.mean(fronts, axis=0).tolist()
    assert 3 < (probability > 0).sum() < 50


def test_of_thousands_that_are_nearly_equal_some_survive_and_what_is_lost_is_said() -> None:
    """Each is the best in far less than a twentieth of the draws."""
    best = Objective(name="lap_s", measure="lap_s", source="time_trial")
    rng, shape = seeded(), (1500, 2)
    lap = 100.0 + np.linspace(0.0, 0.3, shape[0])[:, None] + rng.normal(0.0, 0.5, shape)
    table = pareto(field(lap, np.zeros(shape), np.zeros(shape, int)), [best], rng)
    probability, survives = table["nondominated_probability"].to_numpy(), table["survives"].to_numpy()
    assert probability.max() < 0.05
    assert probability[survives].sum() >= 0.5 * probability.sum()
    assert 10 < survives.sum() < 300
    assert "survivors hold 50 % of the probability" in lost_remark(table)
    assert lost_remark(table.with_columns(survives=True)) == ""
    assert lost_remark(table.clear()) == ""


def test_same_seed_gives_the_same_bytes_and_the_order_of_rows_does_not_matter() -> None:
    _, results = planted(seeded(), 30, 4)
    table = pareto(results, STANDARD, seeded())
    assert table.write_csv() == pareto(results, STANDARD, seeded()).write_csv()
    shuffled = results.sample(fraction=1.0, shuffle=True, seed=1)
    assert_frame_equal(table, pareto(shuffled, STANDARD, seeded()), check_exact=True)
    assert_frame_equal(objectives_table(results, STANDARD), objectives_table(shuffled, STANDARD))


@settings(max_examples=50, deadline=None)
@given(probability=st.lists(st.floats(0.0, 1.0), max_size=20).map(np.array), share=st.floats(0.01, 0.99))
def test_those_in_contention_are_the_fewest_that_hold_the_share(
    probability: NDArray[np.float64], share: float
) -> None:
    chosen = in_contention(probability, share)
    wanted = share * probability.sum()
    assert probability[chosen].sum() >= wanted - 1e-9
    if chosen.any():
        assert probability[chosen].sum() - probability[chosen].min() <= wanted + 1e-9
        assert probability[chosen].min() >= probability[~chosen].max(initial=0.0)
