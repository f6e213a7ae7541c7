"""How entrants behave among others: contacts a kilometre, and the gate that bars those with too many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import polars as pl
from scipy.special import gammaincinv

from nathlon.arena.statistics import interval, spread


@dataclass(frozen=True)
class Gate:
    """Rates, a car and kilometre, that nobody may surely exceed; None where there is no limit.

    Attributes:
        max_contacts_per_km: contacts with other cars.
        max_at_fault_per_km: those of them that the stewards lay to the entrant's car.
    """

    max_contacts_per_km: float | None = None
    max_at_fault_per_km: float | None = None

    @property
    def barred(self) -> pl.Expr:
        """Whose interval lies wholly above a limit, of a table with the columns of `rates`."""
        limits = {"contacts_low": self.max_contacts_per_km, "at_fault_low": self.max_at_fault_per_km}
        above = [pl.col(low) > limit for low, limit in limits.items() if limit is not None]
        return pl.any_horizontal(pl.lit(False), *above).fill_null(False)


def rates(
    seen: pl.DataFrame, count: str, rng: np.random.Generator, resamples: int, confidence: float
) -> pl.DataFrame:
    """Events per car and kilometre of every entrant, `COUNT_per_km`, `COUNT_low` and `COUNT_high`.

    The interval resamples the entrant's units, the ratio made linear at its value, and is nowhere
    shorter than Poisson counting alone allows: no contact in a few km is no proof of none.

    Args:
        seen: `nathlon.tournament.evidence.appearances`.
        count: its column of events: `contacts` or `at_fault`.
        rng: of the bootstrap.
        resamples: of the bootstrap.
        confidence: of the interval.
    """
    names = (f"{count}_per_km", f"{count}_low", f"{count}_high")
    if seen.is_empty():
        return seen.select("entrant", *(pl.lit(None).alias(name) for name in names))
    sides = seen.sort("entrant", maintain_order=True)
    totals = sides.group_by("entrant", maintain_order=True).agg(pl.col(count, "km").sum(), units=pl.len())
    events, km = (totals[name].to_numpy().astype(np.float64) for name in (count, "km"))
    sizes = totals["units"].to_numpy().astype(np.int64)
    km = np.where(km > 0, km, np.inf)
    rate = events / km
    excess = sides[count].to_numpy() - np.repeat(rate, sizes) * sides["km"].to_numpy()
    low, high = interval(rate, np.diag(sizes / km), spread(excess, sizes, resamples, rng), confidence)
    tail = (1 - confidence) / 2
    low = np.fmin(low, np.nan_to_num(gammaincinv(events, tail)) / km)
    high = np.fmax(high, gammaincinv(events + 1, 1 - tail) / km)
    columns = zip(names, (rate, np.maximum(low, 0.0), high), strict=True)
    return totals.select(
        "entrant",
        *(pl.when(pl.col("km") > 0).then(pl.Series(values)).alias(name) for name, values in columns),
    )
