"""What the races of a tournament show: point differences of every two entrants, unit by unit.

The unit of evidence is a mirrored pair of races, or the block of a free-for-all: neither the cars of a
race nor the races of a unit are independent. A unit with a race that is void, or missing, is set aside.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cached_property

import numpy as np
import polars as pl
from numpy.typing import NDArray

from nathlon.arena.results import VOID_ENDINGS
from nathlon.arena.rounding import differing
from nathlon.arena.statistics import (
    Floats,
    Sizes,
    interval,
    p_values,
    precision,
    spread,
    standard_error,
    third_cumulants,
    unskewed,
)

MATCHUP = ("entrant", "opponent")
UNIT = ("test", "match", "unit")
ORDER = ("test", "field", "seed", "match", "unit")
"""Of units, whatever the keys of their matches, which are hashes: what is resampled depends on the order."""

POINTS = ("points", "points_", "difference")
"""What two entrants scored in a unit, a race."""

ENOUGH = 4
"""Units of a matchup that must be alike to show that they do not vary: points are coarse."""


def in_units(results: pl.DataFrame) -> pl.DataFrame:
    """The rows of RESULTS that are part of valid units, with the number of their `unit` and its `races`.

    A unit is as many races of a match, one after the other, as entrants take part in it.
    """
    races = pl.col("races")
    return (
        results.sort("match", "race", "car")
        .with_columns(races=pl.col("entrant").n_unique().over("match"))
        .with_columns(unit=pl.col("race") // races)
        .filter(
            races > 1,
            ~pl.col("ending").is_in(VOID_ENDINGS).any().over(UNIT),
            pl.col("race").n_unique().over(UNIT) == races,
        )
    )


def appearances(results: pl.DataFrame) -> pl.DataFrame:
    """Every entrant's side of every valid unit of some RESULTS, in the `ORDER` of units, then by entrant.

    Of the `races` of a unit, see `in_units`, the entrant started in `started`. `points` are means over the
    unit's races, `first` and `second` over those before and after the mirror; `contacts`, `at_fault` and
    `km` are sums over the entrant's cars, and `field` says who took part, `seed` is that of its first start.
    """
    points, mirrored, races = pl.col("points"), pl.col("mirrored"), pl.col("races")
    return (
        in_units(results)
        .group_by(*UNIT, "entrant", "races", maintain_order=True)
        .agg(
            points.sum() / races.first(),
            pl.col("contacts").sum(),
            pl.col("seed").first(),
            started=pl.col("race").n_unique(),
            at_fault=pl.col("contacts_at_fault").sum(),
            km=pl.col("distance_m").sum() / 1000,
            first=points.filter(~mirrored).sum() * 2 / races.first(),
            second=points.filter(mirrored).sum() * 2 / races.first(),
        )
        .sort(*UNIT, "entrant")
        .with_columns(field=pl.col("entrant").str.join("\n").over(UNIT))
        .sort(*ORDER, "entrant")
    )


def differences(seen: pl.DataFrame) -> pl.DataFrame:
    """Points of every two entrants of every unit: `entrant` minus `opponent`, the first by id, a race.

    Beside the `difference` stand the `points` of the first and the `points_` of the second.
    Ordered by test, field, entrant, opponent, and then as the units are.
    """
    theirs = seen.select(*UNIT, opponent="entrant", points_="points", first_="first", second_="second")
    return (
        seen.join(theirs, on=UNIT)
        .filter(pl.col("entrant") < pl.col("opponent"))
        .with_columns(first=_gap("first"), second=_gap("second"), difference=_gap("points"))
        .select(*UNIT, *MATCHUP, "field", "seed", *POINTS, "first", "second")
        .sort("test", "field", *MATCHUP, *ORDER[2:])
    )


def _gap(points: str) -> pl.Expr:
    """A column less the opponent's; 0 where they are equal within rounding."""
    own, other = pl.col(points), pl.col(f"{points}_")
    size = pl.max_horizontal(own.abs(), other.abs())
    return pl.struct(gap=own - other, size=size).map_batches(
        lambda both: pl.Series(differing(both.struct["gap"].to_numpy(), both.struct["size"].to_numpy())),
        return_dtype=pl.Float64,
    )


def in_common(results: pl.DataFrame, met: pl.DataFrame) -> pl.DataFrame:
    """The `differences` of some RESULTS, of the races in which both took part; null where there are none.

    They are others where some rest: who has met the weakest more often scores more without being better.
    """
    units = results.with_columns(unit=pl.col("race") // pl.col("entrant").n_unique().over("match"))
    theirs = units.group_by(*UNIT, "race", "entrant").agg(pl.col("points").sum())
    both = theirs.join(theirs, on=[*UNIT, "race"], suffix="_").filter(pl.col("entrant") < pl.col("entrant_"))
    common = (
        both.sort("race")
        .group_by(*UNIT, "entrant", opponent="entrant_", maintain_order=True)
        .agg(pl.col("points", "points_").mean())
        .with_columns(difference=_gap("points"))
    )
    return met.drop(*POINTS).join(common, on=[*UNIT, *MATCHUP], how="left", maintain_order="left")


class Cells(ABC):
    """Mean differences of every two entrants, test by test, and the scores that fit them.

    Attributes:
        cells: one row a test, field and matchup: `units`, and their mean `difference`.
        entrants: (K,) ids of those that met another, in order.
        sides: (cells, 2) indices in `entrants` of each cell's two.
        matchups: (M, 2) of those that met, in order.
        shares: (M, cells) weights with which the tests make up a matchup's difference; rows add up to 1.
    """

    def __init__(self, cells: pl.DataFrame, entrants: pl.Series, weights: Mapping[str, float]) -> None:
        """Of cells of these entrants, in order; `weights` of the tests, 1 where a test is not named."""
        self.cells, self.entrants = cells, entrants.to_list()
        sides = [np.searchsorted(entrants.to_numpy(), cells[side].to_numpy()) for side in MATCHUP]
        self.sides = np.stack(sides, 1).astype(np.int64)
        self.matchups, matchup = np.unique(self.sides, axis=0, return_inverse=True)
        weight = np.array([weights.get(test, 1.0) for test in cells["test"]])
        self.shares = np.zeros((len(self.matchups), cells.height))
        self.shares[matchup.ravel(), np.arange(cells.height)] = weight
        self.shares /= self.shares.sum(axis=1, keepdims=True)

    @property
    def means(self) -> Floats:
        """(cells,) mean differences."""
        return self.cells["difference"].to_numpy()

    def estimates(self, combinations: Floats) -> Floats:
        """Linear `combinations` (L, cells) of the means; 0 where it is within rounding."""
        return differing(combinations @ self.means, self.largest)

    @property
    @abstractmethod
    def largest(self) -> float:
        """The most points of a side, whatever their sign: what differences are rounded beside."""

    @cached_property
    def units(self) -> Floats:
        """(M,) units of every matchup; of several tests, as many of one as would tell as much."""
        return 1 / (self.shares**2 / self.cells["units"].to_numpy()).sum(axis=1)

    @cached_property
    def solution(self) -> Floats:
        """(K, cells) what turns `means` into the scores that fit them best, their mean 0.

        The scores s fit the matchups' differences by least squares, s_i - s_j, weighted by their units, so
        that an uneven schedule does no harm. Entrants that did not meet even through others are fitted
        group by group.
        """
        design = np.zeros((len(self.matchups), len(self.entrants)))
        rows = np.arange(len(self.matchups))
        design[rows, self.matchups[:, 0]], design[rows, self.matchups[:, 1]] = 1.0, -1.0
        normal = design.T * self.units
        fit: Floats = np.linalg.pinv(normal @ design, hermitian=True) @ normal @ self.shares
        return fit

    def every_two(self) -> NDArray[np.int64]:
        """(K (K - 1) / 2, 2) indices of every two entrants."""
        return np.array(list(itertools.combinations(range(len(self.entrants)), 2)), np.int64).reshape(-1, 2)

    @abstractmethod
    def errors(self, combinations: Floats) -> tuple[Floats, Floats]:
        """Standard errors (L,) of linear `combinations` (L, cells) of the means, and degrees of freedom."""

    def p_values(self, combinations: Floats) -> Floats:
        """Two-sided p-values (L,) of linear `combinations` (L, cells) of the means against 0: Student's t."""
        return p_values(self.estimates(combinations), *self.errors(combinations))


class Evidence(Cells):
    """The units of a tournament, and what follows from them for linear combinations of their means.

    Attributes:
        seen: `appearances`.
        met: `differences`, or those `in_common`.
        cells: as of `Cells`, with the `deviation` of the differences, and how many `rows` of `met` they have.
    """

    def __init__(self, results: pl.DataFrame, weights: Mapping[str, float], common: bool = False) -> None:
        """Read RESULTS.

        Args:
            results: RESULTS.
            weights: of the tests, 1 where a test is not named.
            common: whether two are compared in the races alone in which both took part.
        """
        self.seen = appearances(results)
        self.met = differences(self.seen)
        difference, cell = pl.col("difference"), ("test", "field", *MATCHUP)
        if common and (self.seen["started"] < self.seen["races"]).any():
            self.met = in_common(results, self.met).filter(difference.is_not_null().any().over(cell))
        cells = self.met.group_by(cell, maintain_order=True).agg(
            difference.mean(),
            deviation=difference.std(),
            units=difference.count().cast(pl.Int64),
            rows=pl.len(),
        )
        super().__init__(cells, self.seen["entrant"].unique().sort(), weights)
        self._weights = weights

    @cached_property
    def largest(self) -> float:
        return float(np.abs(self.seen["points"].to_numpy()).max(initial=0.0))

    @property
    def mean_points(self) -> float:
        """Points that a side scores a race, on average."""
        tests = self.seen.group_by("test", maintain_order=True).agg(pl.col("points").mean())
        weights = [self._weights.get(test, 1.0) for test in tests["test"]]
        return float(np.average(tests["points"].to_numpy(), weights=weights))

    def intervals(
        self, combinations: Floats, rng: np.random.Generator, resamples: int, confidence: float
    ) -> tuple[Floats, Floats]:
        """Confidence intervals of linear `combinations` (L, cells) of the means; units are resampled."""
        values, sizes, weights = self._groups(combinations)
        known = spread(values, sizes, resamples, rng, ENOUGH)
        return interval(self.estimates(combinations), weights, known, confidence)

    def errors(self, combinations: Floats) -> tuple[Floats, Floats]:
        """Standard errors (L,) of linear `combinations` (L, cells) of the means, and degrees of freedom."""
        values, sizes, weights = self._groups(combinations)
        return standard_error(weights, precision(values, sizes, ENOUGH))

    def p_values(self, combinations: Floats) -> Floats:
        """As of `Cells`, and not below what they are without the skewness of the units; see `unskewed`."""
        values, sizes, weights = self._groups(combinations)
        error, freedom = standard_error(weights, precision(values, sizes, ENOUGH))
        estimate = self.estimates(combinations)
        moved = unskewed(estimate, error, weights**3 @ third_cumulants(values, sizes))
        beside = np.where(moved * estimate > 0, p_values(moved, error, freedom), 1.0)
        return np.where(estimate == 0, 1.0, np.maximum(p_values(estimate, error, freedom), beside))

    def _groups(self, combinations: Floats) -> tuple[Floats, Sizes, Floats]:
        """Values, group sizes and weights (L, groups) of independent groups of units.

        The two sides of a pair differ by one number: its values are a group. A block of a free-for-all gives
        many that are not independent: what they add up to in each combination is a group of its own.
        """
        cells, gaps = self.cells, self._dense()
        ends = np.cumsum(cells["rows"].to_numpy())
        values, weights = [], []
        _, opens = np.unique(cells.select(pl.struct("test", "field").rle_id()).to_numpy(), return_index=True)
        for begin, end in zip(opens, [*opens[1:], cells.height], strict=True):
            units = cells["rows"][int(begin)]
            block = gaps[ends[begin] - units : ends[end - 1]].reshape(end - begin, units)
            inside = combinations[:, begin:end]
            if len(block) == 1:
                values.append(block)
                weights.append(inside.T)
            else:
                values.append(inside @ block)
                weights.append(np.eye(len(combinations)))
        sizes = np.array([len(row) for rows in values for row in rows], np.int64)
        flat = np.concatenate([rows.ravel() for rows in values])
        return flat, sizes, np.concatenate(weights).T

    def _dense(self) -> Floats:
        """The differences of all rows of `met`; of a unit in which two did not meet, their mean.

        The others are spread out, so that the mean of them all has the standard error that it has of those.
        """
        if not self.met["difference"].has_nulls():
            return self.met["difference"].to_numpy()
        cells = self.cells.select("test", "field", *MATCHUP, "rows", "units", mean="difference")
        rows = self.met.join(cells, on=["test", "field", *MATCHUP], maintain_order="left")
        mean, gap = pl.col("mean"), pl.col("difference") - pl.col("mean")
        spread_out = mean + gap * (pl.col("rows") / pl.col("units"))
        return rows.select(pl.coalesce(spread_out, mean)).to_series().to_numpy()
