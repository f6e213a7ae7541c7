"""Ratings beside the points, and what does not fit.

Bradley and Terry's strengths use only who scored more in a unit, Plackett and Luce's only the finishing
places; both are fitted to all units at once, so that their order does not matter. Each unit counts as often
as the points of its race do. Where they disagree with the points, or the points with themselves, the
committee should look before it chooses.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import permutations

import numpy as np
import polars as pl
from scipy.optimize import minimize
from scipy.special import fdtrc, logsumexp

from nathlon.arena.results import RATINGS, TOURNAMENT_NOTES
from nathlon.arena.rounding import differing, levelled
from nathlon.arena.statistics import Floats, holm
from nathlon.results.words import percent
from nathlon.tournament.bradley_terry import bradley_terry
from nathlon.tournament.evidence import UNIT, Evidence
from nathlon.tournament.nash import nash_weights
from nathlon.tournament.points import EQUAL, better

PRIOR = 0.5
"""Drawn units that every two entrants are given who met: nobody is infinitely better who won them all."""

REGULAR = 0.01
"""For Plackett and Luce's strengths, likewise: what half their square sum takes from the log-likelihood."""

FITTED = 1e-3
"""Log-odds by which a fitted strength may err; those that are closer are equal."""


def rate(results: pl.DataFrame, weights: Mapping[str, float] = EQUAL) -> pl.DataFrame:
    """Turn the RESULTS of a tournament into RATINGS, by Bradley and Terry's strength, best first.

    A unit's likelihood counts as often as its test: `weights`, as for `nathlon.tournament.points.rank`, made
    1 on average over the units.
    """
    evidence = Evidence(results, weights)
    if evidence.seen.is_empty():
        return pl.DataFrame(schema=RATINGS)
    units = evidence.seen.select(UNIT).unique(maintain_order=True)
    weight = pl.col("test").replace_strict(dict(weights), default=1.0, return_dtype=pl.Float64)
    units = units.with_columns(weight=weight / weight.mean())
    strengths = {
        "bradley_terry": _bradley_terry(evidence, units),
        "plackett_luce": _plackett_luce(results, evidence, units),
    }
    columns: dict[str, object] = {"entrant": evidence.entrants}
    for name, strength in strengths.items():
        level = levelled(strength, FITTED)
        columns |= {name: strength, f"{name}_rank": 1 + (level[None, :] > level[:, None]).sum(axis=1)}
    return (
        pl.DataFrame(columns)
        .select(RATINGS.names())
        .cast(RATINGS)
        .sort("bradley_terry", "entrant", descending=[True, False])
    )


def _bradley_terry(evidence: Evidence, units: pl.DataFrame) -> Floats:
    met = evidence.met.join(units, on=UNIT, maintain_order="left")
    number = {entrant: index for index, entrant in enumerate(evidence.entrants)}
    first, second = (met[side].replace_strict(number).to_numpy() for side in ("entrant", "opponent"))
    share, weight = 0.5 + 0.5 * met["difference"].sign().to_numpy(), met["weight"].to_numpy()
    wins = np.zeros(2 * (len(number),))
    np.add.at(wins, (first, second), weight * share)
    np.add.at(wins, (second, first), weight * (1 - share))
    have_met = (wins + wins.T) > 0
    return bradley_terry(wins + 0.5 * PRIOR * have_met)


def _plackett_luce(results: pl.DataFrame, evidence: Evidence, units: pl.DataFrame) -> Floats:
    """The strengths s of the greatest likelihood.

    Of the cars still to come in, one of entrant i is next with probability exp(s_i) over the sum of exp(s)
    of them all; the cars of an entrant are alike.
    """
    race = ("match", "race")
    cars = (
        results.with_columns(unit=pl.col("race") // pl.col("entrant").n_unique().over("match"))
        .join(units, on=UNIT)
        .sort(*race, "place", "car", descending=[False, False, True, True])
    )
    own = np.stack([cars["entrant"] == entrant for entrant in evidence.entrants], 1).astype(np.float64)
    # From the last car to the first: how many of each entrant are still to come in, this one among them, and
    # those that share its place (Breslow, Biometrics 30, 1974).
    left = cars.select(
        pl.struct(*race, "place").alias("tied"),
        *(
            (pl.col("entrant") == entrant).cum_sum().over(race).alias(f"{number} left")
            for number, entrant in enumerate(evidence.entrants)
        ),
    )
    to_come = left.select(pl.exclude("tied").max().over("tied")).to_numpy()
    weight = cars["weight"].to_numpy()

    def cost(strength: Floats) -> tuple[float, Floats]:
        total = logsumexp(strength, b=to_come, axis=1)
        expected = to_come * np.exp(strength - total[:, None])
        value = weight @ (total - own @ strength) + REGULAR / 2 * strength @ strength
        return value, weight @ (expected - own) + REGULAR * strength

    strength = minimize(cost, np.zeros(len(evidence.entrants)), jac=True, method="L-BFGS-B").x
    return np.asarray(strength - strength.mean())


def notes(
    results: pl.DataFrame,
    names: Mapping[str, str],
    confidence: float = 0.95,
    weights: Mapping[str, float] = EQUAL,
) -> pl.DataFrame:
    """What does not fit in a tournament, TOURNAMENT_NOTES; empty where all does.

    - Of two entrants of whom one scores more beyond doubt, a rating has the other before it.
    - The scores do not explain the differences between entrants: an F-test of the lack of fit.
    - One beats the next beyond doubt, that one a third, and the third the first; then also the mixture that
      nobody beats, see `nathlon.tournament.nash`.

    Args:
        results: RESULTS.
        names: of the entrants, for the sentences.
        confidence: with which anything is said.
        weights: as for `nathlon.tournament.points.rank`.
    """
    evidence = Evidence(results, weights)
    if evidence.seen.is_empty():
        return pl.DataFrame(schema=TOURNAMENT_NOTES)
    alpha = 1 - confidence
    called = [names[entrant] for entrant in evidence.entrants]
    found = [
        *_disagreements(evidence, rate(results, weights), called, alpha),
        *_misfit(evidence, alpha),
        *_cycles(evidence, called, alpha),
    ]
    return pl.DataFrame({"note": found}, schema=TOURNAMENT_NOTES)


def _disagreements(evidence: Evidence, ratings: pl.DataFrame, called: list[str], alpha: float) -> list[str]:
    ratings = ratings.sort("entrant")
    found = []
    for first, second in np.argwhere(better(evidence, alpha)):
        for column, title in (("bradley_terry", "Bradley–Terry"), ("plackett_luce", "Plackett–Luce")):
            rank = ratings[f"{column}_rank"]
            if rank[int(first)] > rank[int(second)]:
                found.append(
                    f"{title} rates {called[second]} above {called[first]}, "
                    f"though {called[first]} scores more points beyond doubt."
                )
    return found


def _misfit(evidence: Evidence, alpha: float) -> list[str]:
    """The matchups' differences against those of the scores, by how much units vary within matchups."""
    scores = evidence.solution @ evidence.means
    gaps = scores[evidence.matchups[:, 0]] - scores[evidence.matchups[:, 1]]
    between = len(evidence.matchups) - len(evidence.entrants) + 1
    units = evidence.cells["units"].to_numpy()
    within = int((units - 1).sum())
    if between < 1 or within < 1 or (evidence.seen["races"] > 2).any():
        return []
    deviation = differing(evidence.cells["deviation"].fill_null(0.0).to_numpy(), evidence.largest)
    noise = float((units - 1) @ deviation**2) / within
    lack = evidence.units @ (evidence.shares @ evidence.means - gaps) ** 2 / between
    if noise == 0 or fdtrc(between, within, lack / noise) > alpha:
        return []
    return [
        "One score for each entrant does not explain all matchups: "
        "against some, an entrant does better or worse than its points say."
    ]


def _cycles(evidence: Evidence, called: list[str], alpha: float) -> list[str]:
    difference = evidence.estimates(evidence.shares)
    sure = holm(evidence.p_values(evidence.shares)) <= alpha
    beats = {
        (int(i), int(j)) if gap > 0 else (int(j), int(i))
        for (i, j), gap in zip(evidence.matchups[sure], difference[sure], strict=True)
    }
    found = [
        f"{called[a]} beats {called[b]}, {called[b]} beats {called[c]}, and {called[c]} beats {called[a]}."
        for a, b, c in permutations(range(len(called)), 3)
        if a < min(b, c) and {(a, b), (b, c), (c, a)} <= beats
    ]
    return [*found, *_mixture(evidence, difference, called)] if found else []


def _mixture(evidence: Evidence, difference: Floats, called: list[str]) -> list[str]:
    """Where there are cycles, whom Nash averaging mixes; who did not meet differs as the scores do."""
    scores = evidence.solution @ evidence.means
    payoff = scores[:, None] - scores
    first, second = evidence.matchups.T
    payoff[first, second], payoff[second, first] = difference, -difference
    weights = nash_weights(payoff).round(2)
    mixed = [int(entrant) for entrant in np.argsort(-weights, kind="stable") if weights[entrant] > 0]
    told = [f"{called[entrant]} {percent(weights[entrant])}" for entrant in mixed]
    return [f"Nobody scores more points against a mixture of {', '.join(told)} (Nash averaging)."]
