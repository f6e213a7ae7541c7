"""The Pareto filter: the checkpoints that may be the best trade of speed, discipline and care."""

from __future__ import annotations

from collections.abc import Sequence

import moocore
import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.special import ndtri

from nathlon.arena.results import PARETO, POLICY_FAULTS
from nathlon.arena.statistics import Floats, group_sums
from nathlon.arena.voids import not_judged_by_tests
from nathlon.results.words import percent
from nathlon.selection.pareto.objective import (
    CONTACTS,
    LAP,
    OFF_COURSE,
    RACE,
    Measured,
    Objective,
    measure,
    own_runs,
    under_test,
    value_column,
)

STANDARD = (LAP, OFF_COURSE, CONTACTS)

HELD = 0.5
"""Share of all the probability to be on the front that survivors hold at least."""

FEW_HELD = 0.9
"""Of which survivors should hold more."""

BORROWED_RUNS = 4
"""Runs that the pooled spread of the field counts as, beside an entrant's own."""

SPREADS = (np.arange(200) + 0.5) / 100
"""Standard deviations between entrants that a draw may have: normal scores of all runs have 1 in all."""


def pareto(
    results: pl.DataFrame,
    objectives: Sequence[Objective],
    rng: np.random.Generator,
    resamples: int = 500,
    keep_probability: float = 0.05,
) -> pl.DataFrame:
    """Turn RESULTS of races and time trials into PARETO, ordered by entrant.

    An entrant survives if it is non-dominated in at least
    `keep_probability` of the draws of what everybody's objectives may truly be; see
    `nondominated_probability`. Of many that are nearly equal, nobody may be; so the fewest that hold `HELD`
    of all this probability survive in any case. Equal objectives do not dominate each other. An entrant
    that has no value in an objective, came through none of the runs of a test, or cannot be judged since
    most of them are void, neither survives nor dominates.
    """
    runs = own_runs(results)
    measured = [measure(runs, objective) for objective in objectives]
    not_judged = {one.entrant for one in not_judged_by_tests(results)}
    contenders = _contenders(runs, objectives, measured, not_judged)
    probability = nondominated_probability([m.of(contenders) for m in measured], resamples, rng)
    columns = [
        *(value_column(measure(runs, objective), objective, objective.name) for objective in STANDARD),
        pl.DataFrame(
            {"entrant": contenders, "nondominated_probability": probability},
            schema={"entrant": pl.String, "nondominated_probability": pl.Float64},
        ),
        runs.filter(pl.col("test") == RACE).group_by("entrant").agg(races=pl.len()),
    ]
    table = under_test(results)
    for column in columns:
        table = table.join(column, on="entrant", how="left", maintain_order="left")
    table = table.with_columns(pl.col("nondominated_probability", "races").fill_null(0))
    kept = surviving(table["nondominated_probability"].to_numpy(), keep_probability)
    return (
        table.with_columns(survives=pl.Series(kept) & ~pl.col("entrant").is_in(not_judged))
        .select(PARETO.names())
        .cast(PARETO)
    )


def lost_remark(table: pl.DataFrame) -> str:
    """What is said of a PARETO that leaves much of the front aside, in a sentence; '' of others."""
    probability, survives = table["nondominated_probability"].to_numpy(), table["survives"].to_numpy()
    held, everything = probability[survives].sum(), probability.sum()
    if not everything or held >= FEW_HELD * everything:
        return ""
    return (
        f"The filter's {survives.sum():,} survivors hold {percent(held / everything)} of the probability of "
        f"being on the front: {table.height:,} entrants are too alike for so few races. Raise "
        " pareto.most_races, or lower pareto.keep_probability."
    )


def came_through(runs: pl.DataFrame, test: str) -> set[str]:
    """The entrants that finished or completed a lap in some run of a test; without laps, who did not fail."""
    through = (
        (pl.col("ending") == "finished")
        | (pl.col("laps") > 0)
        | (pl.col("laps").is_null() & ~pl.col("ending").is_in(POLICY_FAULTS))
    )
    return set(runs.filter((pl.col("test") == test) & through)["entrant"])


def _contenders(
    runs: pl.DataFrame, objectives: Sequence[Objective], measured: Sequence[Measured], not_judged: set[str]
) -> list[str]:
    through = [came_through(runs, test) for test in {objective.source for objective in objectives}]
    return sorted(set.intersection(*through, *(set(m.entrants) for m in measured)) - not_judged)


def nondominated_probability(
    measured: Sequence[Measured], resamples: int, rng: np.random.Generator
) -> Floats:
    """The probability (E,) of each entrant to be non-dominated, from what was measured of them all.

    A parametric bootstrap: `resamples` times the objectives are drawn as they may truly be, each on
    its own, and the front is taken.
    """
    if not measured[0].entrants:
        return np.zeros(0)
    draws = np.stack([draw(objective, resamples, rng) for objective in measured], axis=-1)
    open_ = ~_never_on_front(draws)
    probability = np.zeros(draws.shape[1])
    fronts = [moocore.is_nondominated(np.ascontiguousarray(d), keep_weakly=True) for d in draws[:, open_]]
    probability[open_] = np.mean(fronts, axis=0)
    return probability


def draw(objective: Measured, resamples: int, rng: np.random.Generator) -> Floats:
    """What an objective of E entrants may truly be, as (resamples, E); less is better.

    Dominance asks for the order alone, so costs are first mapped to normal scores of the field's
    runs: in these the spread from run to run is much alike for all entrants, whatever the unit, and
    no lost lap outweighs all else. A variance is pooled from the entrant's own runs and the field's,
    which count as `BORROWED_RUNS` more (Smyth, Statistical Applications in Genetics and Molecular
    Biology 3, 2004), so that one run is enough. Where no entrant has two runs, or all runs of an
    entrant are the same, there is nothing to doubt and nothing is drawn. Otherwise see `draw_means`.
    """
    score = _NormalScores(objective.runs)
    centre, runs, sizes = score(objective.cost), score(objective.runs), objective.sizes
    first = runs[np.cumsum(sizes) - sizes]
    deviations = runs - np.repeat(first, sizes)  # exact zeros where all runs are the same
    squares = group_sums(deviations**2, sizes) - group_sums(deviations, sizes) ** 2 / sizes
    freedom = sizes - 1
    pooled = squares.sum() / max(freedom.sum(), 1)
    variance = (BORROWED_RUNS * pooled + squares) / (BORROWED_RUNS + freedom) / sizes

    if not variance.any():
        return np.repeat(centre[None], resamples, axis=0)
    return draw_means(centre, variance, resamples, rng)


def draw_means(seen: Floats, variance: Floats, resamples: int, rng: np.random.Generator) -> Floats:
    """Draws (resamples, E) of the true means of which `seen` (E,) are estimates of known variance (E,).

    True means are normal about a mean and with a spread that are not known (Gelman et al., Bayesian
    Data Analysis, 3rd edition, section 5.4). Each draw takes a spread, of flat prior over `SPREADS`,
    then a mean, of flat prior, then the true means: shrunk towards it, as an extreme estimate owes
    more to luck. An estimate of the spread would not do: of few entrants it may be nil, and luck
    alone would then order them.
    """
    total = SPREADS[:, None] ** 2 + variance
    weight = 1 / total
    means = weight @ seen / weight.sum(axis=1)
    misfit = (weight * (seen - means[:, None]) ** 2).sum(axis=1)
    log_density = -(misfit + np.log(total).sum(axis=1) + np.log(weight.sum(axis=1))) / 2
    density = np.exp(log_density - log_density.max())
    drawn = rng.choice(len(SPREADS), resamples, p=density / density.sum())
    noise = rng.standard_normal((resamples, 1 + len(seen)))
    mean = means[drawn, None] + noise[:, :1] / np.sqrt(weight[drawn].sum(axis=1, keepdims=True))
    trust = SPREADS[drawn, None] ** 2 / total[drawn]
    return mean + trust * (seen - mean) + noise[:, 1:] * np.sqrt(trust * variance)


class _NormalScores:
    """The increasing map from costs to the normal quantiles of their ranks among some costs."""

    def __init__(self, costs: Floats) -> None:
        self._costs, counts = np.unique(costs, return_counts=True)
        self._scores = ndtri((np.cumsum(counts) - counts / 2) / len(costs))

    def __call__(self, costs: Floats) -> Floats:
        return np.interp(costs, self._costs, self._scores)


def _never_on_front(draws: Floats) -> NDArray[np.bool_]:
    """Which of E entrants one and the same other dominates in all of the draws (resamples, E, K)."""
    worst, best = draws.max(axis=0), draws.min(axis=0)
    rulers = worst[moocore.is_nondominated(worst, keep_weakly=True)]
    no_worse = (rulers <= best[:, None]).all(axis=-1)
    better = (rulers < best[:, None]).any(axis=-1)
    return (no_worse & better).any(axis=1)


def surviving(probability: Floats, keep_probability: float) -> NDArray[np.bool_]:
    """Which of E entrants of a probability (E,) to be on the front survive; see `pareto`."""
    return (probability >= keep_probability) | in_contention(probability, HELD)


def in_contention(probability: Floats, share: float = 0.99) -> NDArray[np.bool_]:
    """The fewest entrants (E,) that together hold a share of all the probability to be on the front.

    Of equal ones those that come first. None where nobody has any.
    """
    order = np.argsort(-probability, kind="stable")
    held = np.cumsum(probability[order])
    needed = np.searchsorted(held, share * held[-1]) + 1 if len(held) and held[-1] > 0 else 0
    chosen = np.zeros(len(probability), bool)
    chosen[order[:needed]] = True
    return chosen
