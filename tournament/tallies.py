"""What is kept of many tournaments instead of their races: enough to rank entrants as if all were there.

Of every matchup these are the units, the mean of their differences and the squares of what they differ from
it by. They are added from tournament to tournament (Chan, Golub and LeVeque, The American Statistician 37,
1983), so that one more takes as long as the first.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import NamedTuple

import numpy as np
import polars as pl
from scipy.special import gammaincinv, stdtrit

from nathlon.arena.results import POLICY_FAULTS, POOL_CELLS, POOL_TOTALS, RANKING
from nathlon.arena.statistics import Floats, possible_ranks
from nathlon.tournament.evidence import ENOUGH, MATCHUP, Cells, appearances, differences
from nathlon.tournament.points import EQUAL, better

CELL = ("test", "field", *MATCHUP)
SCORED = {
    "entrant": pl.String,
    "points_per_race": pl.Float64,
    "points_low": pl.Float64,
    "points_high": pl.Float64,
    "rank": pl.Int64,
    "worst_rank": pl.Int64,
}
ALIKE = 1e-9
"""Points: units that differ by less do not differ."""


class Tally(NamedTuple):
    """What is kept.

    Attributes:
        cells: POOL_CELLS, of every two entrants that met, test by test.
        totals: POOL_TOTALS, of every entrant.
    """

    cells: pl.DataFrame = pl.DataFrame(schema=POOL_CELLS)
    totals: pl.DataFrame = pl.DataFrame(schema=POOL_TOTALS)

    @classmethod
    def of(cls, results: pl.DataFrame) -> Tally:
        """That of the RESULTS of a tournament."""
        seen = appearances(results)
        difference = pl.col("difference")
        cells = (
            differences(seen)
            .group_by(CELL)
            .agg(
                difference.mean(),
                units=pl.len(),
                squares=((difference - difference.mean()) ** 2).sum(),
            )
            .join(seen.group_by("test", "field").agg(pl.col("points").mean()), on=("test", "field"))
        )
        sums = seen.group_by("entrant").agg(
            pl.col("contacts", "at_fault", "km").sum(),
            pl.col("contacts", "at_fault", "km").pow(2).sum().name.suffix("_squared"),
            units=pl.len(),
            races=pl.col("started").sum(),
            contacts_km=(pl.col("contacts") * pl.col("km")).sum(),
            at_fault_km=(pl.col("at_fault") * pl.col("km")).sum(),
        )
        faults = results.group_by("entrant").agg(faults=pl.col("ending").is_in(POLICY_FAULTS).sum())
        totals = faults.join(sums, on="entrant", how="left").fill_null(0)
        return cls(_as(cells, POOL_CELLS, CELL), _as(totals, POOL_TOTALS, ("entrant",)))

    @classmethod
    def together(cls, tallies: Iterable[Tally]) -> Tally:
        """That of several tournaments with different units."""
        all_cells, all_totals = zip(*tallies, strict=True)
        units, difference = pl.col("units"), pl.col("difference")
        mean = (difference * units).sum() / units.sum()
        cells = (
            pl.concat(all_cells)
            .group_by(CELL)
            .agg(
                units.sum(),
                difference=mean,
                squares=pl.col("squares").sum() + (units * (difference - mean) ** 2).sum(),
                points=(pl.col("points") * units).sum() / units.sum(),
            )
        )
        totals = pl.concat(all_totals).group_by("entrant").agg(pl.all().sum())
        return cls(_as(cells, POOL_CELLS, CELL), _as(totals, POOL_TOTALS, ("entrant",)))

    def among(self, entrants: Collection[str]) -> Tally:
        """What these entrants did, and how those of them that met came out."""
        names = list(entrants)
        return Tally(
            self.cells.filter(pl.col("entrant").is_in(names), pl.col("opponent").is_in(names)),
            self.totals.filter(pl.col("entrant").is_in(names)),
        )


def _as(frame: pl.DataFrame, schema: pl.Schema, order: tuple[str, ...]) -> pl.DataFrame:
    return frame.select(schema.names()).cast(schema).sort(order)


class Tallied(Cells):
    """The cells of a tally, and what follows from them for linear combinations of their means."""

    def __init__(self, cells: pl.DataFrame) -> None:
        """Of POOL_CELLS."""
        entrants = pl.concat([cells[side].alias("entrant") for side in MATCHUP]).unique().sort()
        super().__init__(cells.sort(CELL), entrants, EQUAL)

    @property
    def largest(self) -> float:
        known = self.cells.select(pl.col("points", "difference").abs().max())
        return float(max(known.row(0)))

    @property
    def mean_points(self) -> float:
        """Points that a side scores a race, on average, the same for all tests."""
        sides = pl.col("units") * (pl.col("field").str.count_matches("\n") + 1)
        fields = self.cells.unique(("test", "field")).with_columns(sides=sides)
        tests = fields.group_by("test").agg(
            (pl.col("points") * pl.col("sides")).sum() / pl.col("sides").sum()
        )
        return float(tests["points"].mean())  # type: ignore[arg-type]

    def errors(self, combinations: Floats) -> tuple[Floats, Floats]:
        """As of `Cells`; a cell borrows the spread of others as in `nathlon.arena.statistics.precision`."""
        groups = list(self._groups(combinations))
        alike = [(squares <= units * ALIKE**2) & (units < ENOUGH) for _, units, squares in groups]
        pooled, freedom = 0.0, 0
        for same, (_, units, squares) in zip(alike, groups, strict=True):
            pooled += float(squares[~same].sum())
            freedom += int(np.broadcast_to(units - 1, same.shape)[~same].sum())
        total, spread = np.zeros((2, len(combinations)))
        with np.errstate(invalid="ignore", divide="ignore"):
            for same, (weights, units, squares) in zip(alike, groups, strict=True):
                own = np.where(same, freedom, units - 1)
                terms = weights**2 * np.where(same, pooled, squares) / own / units
                total += terms.sum(axis=1)
                spread += (terms**2 / own).sum(axis=1)
            return np.sqrt(total), np.where(total == 0, 1.0, total**2 / spread)

    def _groups(self, combinations: Floats) -> Iterator[tuple[Floats, Floats, Floats]]:
        """Weights, units and squares of independent groups of units; see `Evidence`.

        Those of two entrants together, of one value each; then block by block, of what each of the
        combinations (L, cells) adds up to there.
        """
        units, squares = (self.cells[name].to_numpy() for name in ("units", "squares"))
        _, opens = np.unique(
            self.cells.select(pl.struct("test", "field").rle_id()).to_numpy(), return_index=True
        )
        ends = np.append(opens[1:], len(units))
        two = opens[ends - opens == 1]
        yield combinations[:, two], units[two], squares[two][None]
        for begin, end in zip(opens, ends, strict=True):
            if end - begin > 1:
                yield (
                    np.ones((1, 1)),
                    units[[begin]],
                    self._together(combinations, squares, begin, end)[:, None],
                )

    def _together(self, combinations: Floats, squares: Floats, begin: int, end: int) -> Floats:
        """Squares (L,) of what the differences of a block add up to, each weighted as in a combination.

        The weights of the entrants' points add up to 0, so that those of their differences are enough.
        """
        first, second = self.sides[begin:end].T
        points = np.zeros((len(combinations), len(self.entrants)))
        np.add.at(points.T, first, combinations[:, begin:end].T)
        np.add.at(points.T, second, -combinations[:, begin:end].T)
        return np.maximum(-(points[:, first] * points[:, second]) @ squares[begin:end], 0.0)


def rank_tally(tally: Tally, confidence: float = 0.95) -> pl.DataFrame:
    """Turn a tally into RANKING, best first, as `nathlon.tournament.points.rank` does with all the races.

    Points are the same. Intervals are by Student's t: there is nothing left to resample. So are ranks: how
    skewed the units are is not kept, see `nathlon.arena.statistics.unskewed`.
    """
    scored = pl.DataFrame(schema=SCORED) if tally.cells.is_empty() else _scores(tally.cells, confidence)
    table = tally.totals.join(scored, on="entrant", how="left")
    for count in ("contacts", "at_fault"):
        table = table.join(_rates(tally.totals, count, confidence), on="entrant", how="left")
    return (
        table.rename({"units": "pairs"})
        .with_columns(barred=False)
        .with_columns(pl.col(pl.Float64).fill_nan(None))
        .sort("points_per_race", "entrant", descending=[True, False], nulls_last=True)
        .select(RANKING.names())
        .cast(RANKING)
    )


def _scores(cells: pl.DataFrame, confidence: float) -> pl.DataFrame:
    tallied = Tallied(cells)
    scores = tallied.solution @ tallied.means + tallied.mean_points
    error, freedom = tallied.errors(tallied.solution)
    half = stdtrit(freedom, (1 + confidence) / 2) * error
    ranks = possible_ranks(better(tallied, 1 - confidence))
    columns = (tallied.entrants, scores, scores - half, scores + half, *ranks)
    return pl.DataFrame(dict(zip(SCORED, columns, strict=True)))


def _rates(totals: pl.DataFrame, count: str, confidence: float) -> pl.DataFrame:
    """Events per car and kilometre of every entrant; see `nathlon.tournament.conduct.rates`."""
    driven = totals.filter(pl.col("km") > 0)
    units, events, km = (driven[name].to_numpy().astype(np.float64) for name in ("units", count, "km"))
    rate = events / km
    products = (driven[f"{count}{what}"].to_numpy() for what in ("_squared", "_km"))
    squared, crossed = (values.astype(np.float64) for values in products)
    excess = np.maximum(squared - 2 * rate * crossed + rate**2 * driven["km_squared"].to_numpy(), 0.0)
    pooled, freedom = excess[units > 1].sum(), (units - 1).sum()
    with np.errstate(invalid="ignore", divide="ignore"):
        own = np.where(units > 1, units - 1, freedom)
        error = np.sqrt(np.where(units > 1, excess, pooled) / own / units) * units / km
    half = stdtrit(own, (1 + confidence) / 2) * error
    tail = (1 - confidence) / 2
    low = np.fmin(rate - half, np.nan_to_num(gammaincinv(events, tail)) / km)
    high = np.fmax(rate + half, gammaincinv(events + 1, 1 - tail) / km)
    columns = {"entrant": driven["entrant"], f"{count}_per_km": rate}
    return pl.DataFrame(columns | {f"{count}_low": np.maximum(low, 0.0), f"{count}_high": high})
