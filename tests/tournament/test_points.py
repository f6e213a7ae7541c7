"""Team points: the fit, its intervals, ties, mirrored pairs and faults."""

import hashlib
from itertools import combinations

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray
from polars.testing import assert_frame_equal
from scipy.stats import ttest_1samp

from nathlon.arena.classification import PLACE_POINTS
from nathlon.arena.results import MATCHUPS, RANKING, RESULTS
from nathlon.arena.statistics import (
    holm,
    interval,
    p_values,
    possible_ranks,
    precision,
    spread,
    standard_error,
    third_cumulants,
    unskewed,
)
from nathlon.tournament.conduct import Gate, rates
from nathlon.tournament.evidence import Cells, Evidence, appearances
from nathlon.tournament.points import EQUAL, better, matchups, pair_correlation, rank
from tests.support.race_results import duels, rows, tournament

PACE = {"a": 0.0, "b": 0.5, "c": 1.0, "d": 1.5}


def seeded() -> np.random.Generator:
    return np.random.default_rng(11)


def sweep(match: str, home: str, away: str, difference: float, pairs: int = 1) -> pl.DataFrame:
    """A match in which `home` scores `difference` more than `away` in every race, cars 10 km each."""
    height = pairs * 4
    return rows(
        {
            "match": match,
            "race": np.arange(height) // 2,
            "mirrored": np.arange(height) // 2 % 2 == 1,
            "car": np.arange(height) % 2,
            "team": np.arange(height) % 2,
            "entrant": np.where(np.arange(height) % 2 == 0, home, away),
            "points": np.where(np.arange(height) % 2 == 0, 19.5 + difference / 2, 19.5 - difference / 2),
        },
        height,
    )


def test_consistent_differences_are_fitted_exactly_by_an_uneven_schedule() -> None:
    """a - b = 6 twelve times, b - c = 4 once, a and c never meet: the scores are 19.5 + (16, -2, -14) / 3."""
    results = pl.concat([sweep("m1", "a", "b", 6, pairs=12), sweep("m2", "c", "b", -4)])
    ranking = rank(results, seeded())
    assert ranking["entrant"].to_list() == ["a", "b", "c"]
    np.testing.assert_allclose(ranking["points_per_race"], [19.5 + 16 / 3, 19.5 - 2 / 3, 19.5 - 14 / 3])
    assert ranking["pairs"].to_list() == [12, 13, 1]
    assert ranking["races"].to_list() == [24, 26, 2]


def test_two_entrants_score_their_own_mean_team_points() -> None:
    results = tournament({"a": 0.0, "b": 0.6}, 6, seeded())
    by_team = results.group_by("entrant").agg(pl.col("points").sum() / 12)
    expected = dict(by_team.iter_rows())
    for entrant, points in rank(results, seeded()).select("entrant", "points_per_race").iter_rows():
        assert points == pytest.approx(expected[entrant])


def test_a_planted_order_is_recovered() -> None:
    ranking = rank(tournament(PACE, 40, seeded()), seeded())
    assert ranking["entrant"].to_list() == ["d", "c", "b", "a"]
    assert ranking["rank"].to_list() == [1, 2, 3, 4]
    assert ranking["points_per_race"].mean() == pytest.approx(sum(PLACE_POINTS) / 2)


def test_among_equal_entrants_any_false_difference_is_rare() -> None:
    """At most 5 % of tournaments of eight tell any two apart, give or take two standard errors."""
    rng = seeded()
    replications = 80
    equal = dict.fromkeys("abcdefgh", 0.0)
    false = sum(better(Evidence(tournament(equal, 4, rng), EQUAL), 0.05).any() for _ in range(replications))
    assert false / replications <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / replications)


def test_skewness_is_taken_for_no_difference() -> None:
    """Of two with equal means one now and then loses all: Student's t alone tells 7 % of them apart."""
    rng, runs, units = seeded(), 400, 12
    told = alone = 0
    for _ in range(runs):
        gaps = 6 * (1 - rng.standard_exponential(units))
        evidence = Evidence(duels({("a", "b"): gaps.tolist()}), EQUAL)
        told += evidence.p_values(evidence.shares)[0] <= 0.02
        alone += Cells.p_values(evidence, evidence.shares)[0] <= 0.02
    assert told < 0.7 * alone
    assert told / runs <= 0.04


def test_what_is_beyond_doubt_stays_so() -> None:
    gaps = (9 + 6 * seeded().standard_normal(24)).tolist()
    evidence = Evidence(duels({("a", "b"): gaps}), EQUAL)
    assert evidence.p_values(evidence.shares)[0] < 1e-4


def test_ranks_count_those_that_are_better_after_correction() -> None:
    results = tournament(PACE | {"e": 1.45}, 8, seeded())
    evidence = Evidence(results, EQUAL)
    wins = better(evidence, 0.05)
    ranks = dict(rank(results, seeded()).select("entrant", "rank").iter_rows())
    for index, entrant in enumerate(evidence.entrants):
        assert ranks[entrant] == 1 + wins[:, index].sum()
    assert ranks["d"] == ranks["e"] == 1
    assert not (wins & wins.T).any()


def test_holms_adjustment_is_that_of_his_example() -> None:
    p = np.array([0.01, 0.04, 0.03, 0.005])
    np.testing.assert_allclose(holm(p), [0.03, 0.06, 0.06, 0.02])
    assert holm(np.array([0.5, 0.9])).tolist() == [1.0, 1.0]
    assert holm(np.array([])).size == 0


def test_p_values_are_those_of_students_t() -> None:
    x = np.array([2.0, -0.5, 1.5, 3.0, 0.2])
    known = precision(x, np.array([5]))
    error, freedom = standard_error(np.eye(1), known)
    assert p_values(np.array([x.mean()]), error, freedom)[0] == pytest.approx(ttest_1samp(x, 0.0).pvalue)
    assert p_values(np.array([1.0]), np.array([np.nan]), np.array([3.0])).tolist() == [1.0]
    assert p_values(np.array([0.0, 1.0]), np.zeros(2), np.full(2, 3.0)).tolist() == [1.0, 0.0]


def test_t_is_centred_once_skewness_is_taken_out() -> None:
    """Of means of a hundred numbers that are skewed: their own t lies too low by a tenth on average."""
    units = np.random.default_rng(2).exponential(size=(4000, 100)) - 1.0
    estimate, error = units.mean(axis=1), units.std(axis=1, ddof=1) / 10.0
    third = third_cumulants(units.ravel(), np.full(4000, 100))
    assert np.mean(estimate / error) < -0.09
    assert abs(np.mean(unskewed(estimate, error, third) / error)) < 0.04


def test_a_race_that_counts_double_weighs_double() -> None:
    """a scores 6 more than b in the short race and 12 less in the long one."""
    results = pl.concat(
        [
            sweep("m1", "a", "b", 6, pairs=3).with_columns(test=pl.lit("short")),
            sweep("m2", "a", "b", -12, pairs=5).with_columns(test=pl.lit("long")),
        ]
    )
    for weights, gap in (({}, -3.0), ({"long": 2.0}, -6.0), ({"long": 1.0, "short": 3.0}, 1.5)):
        points = dict(
            rank(results, seeded(), weights=weights).select("entrant", "points_per_race").iter_rows()
        )
        assert points["a"] - points["b"] == pytest.approx(gap)
        table = matchups(results, seeded(), weights=weights)
        assert table["difference"].to_list() == [pytest.approx(gap), pytest.approx(-gap)]
        assert table["points_per_race"][0] - table["points_per_race"][1] == pytest.approx(gap)
        assert table["pairs"].to_list() == [8, 8]


def test_an_event_of_equal_tests_is_one_tournament() -> None:
    """Halves of the same races under two names: the same scores, and nearly the same intervals."""
    results = tournament(PACE, 12, seeded())
    halves = results.with_columns(test=pl.when(pl.col("race") < 12).then(pl.lit("x")).otherwise(pl.lit("y")))
    whole, event = (rank(table, seeded()) for table in (results, halves))
    np.testing.assert_allclose(whole["points_per_race"], event["points_per_race"])
    np.testing.assert_allclose(whole["points_low"], event["points_low"], atol=0.35)
    assert whole["rank"].to_list() == event["rank"].to_list()


def test_the_gate_bars_whose_interval_lies_above_it_and_keeps_the_points() -> None:
    results = tournament(PACE, 6, seeded()).with_columns(
        contacts=pl.when(pl.col("entrant") == "d").then(12).otherwise(pl.col("contacts")),
        contacts_at_fault=pl.when(pl.col("entrant") == "c").then(3).otherwise(0),
    )
    free = rank(results, seeded())
    assert not free["barred"].any()
    at_fault = dict(free.select("entrant", "at_fault_per_km").iter_rows())
    assert at_fault == {"a": 0.0, "b": 0.0, "c": pytest.approx(0.3), "d": 0.0}
    for gate, barred in (
        (Gate(max_contacts_per_km=0.5), {"d"}),
        (Gate(max_at_fault_per_km=0.1), {"c"}),
        (Gate(0.5, 0.1), {"c", "d"}),
        (Gate(2.0, 0.4), set()),
    ):
        ranking = rank(results, seeded(), gate=gate)
        assert set(ranking.filter("barred")["entrant"]) == barred
        assert_frame_equal(ranking.drop("barred"), free.drop("barred"))


@pytest.mark.parametrize("pairs", [4, 10])
def test_the_intervals_cover_the_true_scores(pairs: int) -> None:
    """95 % intervals cover 93-97 %. The pair differences of very many races stand for the truth."""
    rng = seeded()
    replications = 250
    many = matchups(tournament(PACE, 4000, rng), rng, resamples=1)
    mean_difference = many.group_by("entrant").agg(pl.col("difference").sum() / len(PACE))
    truth = {name: sum(PLACE_POINTS) / 2 + mean for name, mean in mean_difference.iter_rows()}

    names, meetings = list(PACE), list(combinations(range(len(PACE)), 2))
    sample = _pair_differences(replications * pairs, rng).reshape(len(meetings), replications, pairs)
    design = np.zeros((len(meetings), len(names)))
    for row, (home, away) in enumerate(meetings):
        design[row, home], design[row, away] = 1, -1
    solution = np.linalg.pinv(design).astype(np.float64)
    expected = np.array([truth[name] for name in names])
    covered = []
    for differences in sample.swapaxes(0, 1):
        scores: NDArray[np.float64] = solution @ differences.mean(axis=1) + sum(PLACE_POINTS) / 2
        sizes = np.full(len(meetings), pairs)
        low, high = interval(scores, solution, spread(differences.ravel(), sizes, 400, rng), 0.95)
        covered.append((low <= expected) & (expected <= high))
    assert 0.93 <= np.mean(covered) <= 0.97


def _pair_differences(pairs: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Differences of team points a race in independent pairs, (matchups, pairs)."""
    results = tournament(PACE, pairs, rng).with_columns(
        pair=pl.col("race") // 2, gain=pl.col("points") * (1 - 2 * pl.col("team")) / 2
    )
    gains = results.group_by("match", "pair", maintain_order=True).agg(pl.col("gain").sum())
    return gains["gain"].to_numpy().reshape(-1, pairs)


def test_rank_uses_the_covering_interval() -> None:
    """The ranking's bounds are those of the interval whose coverage is tested, up to the resampling."""
    results = tournament({"a": 0.0, "b": 0.5}, 8, seeded())
    ranking = rank(results, seeded(), resamples=20_000)
    difference = (
        results.filter(pl.col("entrant") == "a").group_by(pl.col("race") // 2).agg(pl.col("points").sum() / 2)
    )["points"].to_numpy()
    low, high = interval(
        np.array([difference.mean()]), np.eye(1), spread(difference, np.array([8]), 20_000, seeded()), 0.95
    )
    row = ranking.row(by_predicate=pl.col("entrant") == "a", named=True)
    assert row["points_low"] == pytest.approx(low[0], abs=0.1)
    assert row["points_high"] == pytest.approx(high[0], abs=0.1)


def test_mirroring_takes_the_grid_out_of_the_scores_and_shows_in_the_correlation() -> None:
    """With a decisive grid and no luck of the pair, unmirrored races would crown whoever starts from pole."""
    results = tournament({"a": 0.0, "b": 0.0}, 400, seeded(), grid_advantage=2.0, pair_effect=0.0)
    first_races = results.filter(~pl.col("mirrored")).group_by("entrant").agg(pl.col("points").sum() / 400)
    assert dict(first_races.iter_rows())["a"] > 21
    points, low, high = rank(results, seeded()).select("points_per_race", "points_low", "points_high").row(0)
    assert abs(points - sum(PLACE_POINTS) / 2) < high - low  # about four standard errors
    assert high - low < 1
    assert pair_correlation(results) == pytest.approx(0.0, abs=0.15)


def test_what_helps_a_team_in_both_races_correlates_them() -> None:
    shared = pair_correlation(tournament(PACE, 200, seeded(), pair_effect=1.5))
    independent = pair_correlation(tournament(PACE, 200, seeded(), pair_effect=0.0))
    assert shared is not None
    assert shared > 0.5
    assert independent == pytest.approx(0.0, abs=0.1)


def test_the_correlation_needs_pairs_that_differ() -> None:
    assert pair_correlation(sweep("m", "a", "b", 6, pairs=8)) is None
    assert pair_correlation(tournament(PACE, 1, seeded())) is None
    assert pair_correlation(pl.DataFrame(schema=RESULTS)) is None


def test_same_seed_gives_the_same_bytes_and_the_order_of_rows_does_not_matter() -> None:
    results = tournament(PACE, 5, seeded()).with_columns(distance_m=pl.Series(seeded().random(480) * 1e4))
    shuffled = results.sample(fraction=1.0, shuffle=True, seed=3)
    for table in (rank, matchups):
        first = table(results, seeded()).write_csv()
        assert first == table(results, seeded()).write_csv()
        assert first == table(shuffled, seeded()).write_csv()
    assert pair_correlation(results) == pair_correlation(shuffled)


def test_the_same_races_under_other_keys_give_the_same_bounds() -> None:
    """Keys of matches are hashes, which change with the program; each matchup here has three of them."""
    made = tournament(PACE, 12, seeded())
    parts = pl.col("race") // 8
    made = made.with_columns(
        match=pl.format("{} {}", "match", parts), race=pl.col("race") % 8, seed=100 + pl.col("race") // 2
    )
    told = []
    for salt in (b"one", b"two", b"three"):
        keys = {key: hashlib.sha256(salt + key.encode()).hexdigest() for key in made["match"].unique()}
        results = made.with_columns(pl.col("match").replace_strict(keys)).sort("match", "race", "car")
        told.append((rank(results, seeded()), matchups(results, seeded())))
    for ranking, matchup in told[1:]:
        assert ranking.equals(told[0][0])
        assert matchup.equals(told[0][1])


def test_who_is_called_team_0_does_not_matter() -> None:
    results = tournament(PACE, 5, seeded())
    swapped = results.with_columns(team=1 - pl.col("team"))
    assert_frame_equal(rank(results, seeded()), rank(swapped, seeded()))
    assert_frame_equal(matchups(results, seeded()), matchups(swapped, seeded()))


def test_a_simulator_fault_voids_its_whole_pair_and_a_policy_fault_scores() -> None:
    results = tournament({"a": 0.0, "b": 0.5}, 6, seeded())
    faulted = results.with_columns(
        ending=pl.when((pl.col("race") == 5) & (pl.col("car") == 2))
        .then(pl.lit("simulator_fault"))
        .when((pl.col("race") == 0) & (pl.col("car") == 1))
        .then(pl.lit("policy_raised"))
        .when((pl.col("race") == 4) & (pl.col("car") == 1))
        .then(pl.lit("illegal_action"))
        .otherwise("ending")
    )
    without = rank(results.filter(pl.col("race") // 2 != 2), seeded())
    ranking = rank(faulted, seeded())
    assert_frame_equal(ranking.drop("faults"), without.drop("faults"))
    assert dict(ranking.select("entrant", "faults").iter_rows()) == {"a": 0, "b": 2}
    assert set(ranking["pairs"]) == {5}


def test_a_pair_that_lacks_a_race_is_set_aside() -> None:
    results = tournament({"a": 0.0, "b": 0.5}, 4, seeded())
    assert rank(results.filter(pl.col("race") != 7), seeded())["pairs"].to_list() == [3, 3]


def test_one_entrant_none_or_no_pair_at_all() -> None:
    empty = rank(pl.DataFrame(schema=RESULTS), seeded())
    assert empty.schema == RANKING
    assert empty.is_empty()
    assert matchups(pl.DataFrame(schema=RESULTS), seeded()).schema == MATCHUPS
    alone = rank(rows({"entrant": "a", "race": [0, 1], "mirrored": [False, True]}, 2), seeded())
    assert alone.schema == RANKING
    assert alone.row(0, named=True) == {
        **dict.fromkeys(RANKING.names()),
        "entrant": "a",
        "pairs": 0,
        "races": 0,
        "barred": False,
        "faults": 0,
    }


def test_few_pairs_alike_borrow_the_spread_of_the_others_or_have_no_interval() -> None:
    for pairs in (1, 3):
        ranking = rank(sweep("m", "a", "b", 6, pairs), seeded())
        assert ranking["points_per_race"].to_list() == [22.5, 16.5]
        assert ranking["rank"].to_list() == [1, 1], "two or three alike may be so by chance"
        assert ranking["points_low"].null_count() == 2
    assert rank(sweep("m", "a", "b", 6, 4), seeded())["rank"].to_list() == [1, 2]
    beside = matchups(pl.concat([tournament(PACE, 6, seeded()), sweep("m", "a", "z", 6)]), seeded())
    row = beside.row(by_predicate=(pl.col("entrant") == "a") & (pl.col("opponent") == "z"), named=True)
    assert row["difference_low"] < 2 < 10 < row["difference_high"]


def test_a_matchup_is_told_the_same_from_both_sides() -> None:
    results = tournament(PACE, 6, seeded())
    table = matchups(results, seeded())
    assert table.height == len(PACE) * (len(PACE) - 1)
    by_side = {(row["entrant"], row["opponent"]): row for row in table.iter_rows(named=True)}
    for (entrant, opponent), row in by_side.items():
        other = by_side[opponent, entrant]
        assert row["difference"] == -other["difference"]
        assert row["difference_low"] == -other["difference_high"]
        assert row["difference_low"] <= row["difference"] <= row["difference_high"]
        assert row["points_per_race"] - other["points_per_race"] == pytest.approx(row["difference"])
        assert row["pairs"] == 6
    own = results.filter(pl.col("entrant") == "a", pl.col("match") == "a v b")
    assert by_side["a", "b"]["contacts_per_km"] == own["contacts"].to_numpy().sum() / (
        own["distance_m"].to_numpy().sum() / 1000
    )


def test_contact_rates_cover_the_truth_and_no_contact_is_no_proof_of_none() -> None:
    rng = seeded()
    covered = []
    for _ in range(60):
        seen = appearances(tournament(dict.fromkeys("abcd", 0.0), 4, rng))
        table = rates(seen, "contacts", rng, 300, 0.95)
        covered += [low <= 0.05 <= high for low, high in table.select("contacts_low", "contacts_high").rows()]
    assert np.mean(covered) >= 0.93
    clean = rank(sweep("m", "a", "b", 6, pairs=5), seeded()).row(0, named=True)
    assert (clean["contacts_per_km"], clean["contacts_low"]) == (0, 0)
    assert clean["contacts_high"] == pytest.approx(-np.log(0.025) / 100)  # exact Poisson bound over 100 km


def test_a_car_that_never_moved_has_no_contact_rate() -> None:
    results = sweep("m", "a", "b", 6, pairs=5).with_columns(
        distance_m=pl.when(pl.col("entrant") == "b").then(0.0).otherwise("distance_m")
    )
    bounds = dict(rank(results, seeded()).select("entrant", "contacts_high").iter_rows())
    assert bounds["b"] is None
    assert bounds["a"] is not None
    assert rank(results, seeded())["contacts_per_km"].to_list() == [0.0, None]
    assert matchups(results, seeded())["contacts_per_km"].to_list() == [0.0, None]


def test_ranks_reach_from_those_proven_better_to_those_proven_worse() -> None:
    better = np.zeros((4, 4), np.bool_)
    better[0, 2:] = better[1:3, 3] = True
    best, worst = possible_ranks(better)
    assert list(zip(best.tolist(), worst.tolist(), strict=True)) == [(1, 2), (1, 3), (2, 3), (4, 4)]
