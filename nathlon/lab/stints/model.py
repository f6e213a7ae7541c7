"""What a lap takes: by compound, age of the tyres and fuel, fitted to practice, with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.special import stdtrit

from nathlon.policies.stint_model import CompoundLaps, StintModel
from nathlon.sim.errors import InputError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LapModel:
    """Lap times as sums of coefficients, by least squares.

    The coefficients are one for each compound and age of its tyres, one for a kilogram of fuel, one for the
    start, and one for a stop without its service. Only sums over whole races are known: tyres may take more
    if start and stop take less.

    Attributes:
        compounds: by whose names the model goes.
        ages: laps on one set of tyres that were practised, at most.
        lasted: (compounds,) the same on each.
        coefficients: (k,) s.
        covariance: (k, k) of them.
        freedom: degrees of freedom of the residuals.
        used_kg: (compounds, ages) fuel that a lap takes, kg: the faster, the more.
        wear: (compounds, ages) of the tyres at its end, mean of the four.
    """

    compounds: tuple[str, ...]
    ages: int
    lasted: tuple[int, ...]
    coefficients: Floats
    covariance: Floats
    freedom: int
    used_kg: Floats
    wear: Floats

    def tyres(self, compound: int, laps: int) -> Floats:
        """Counts (k,) of the coefficients in a stint of so many laps, without start, stop and fuel."""
        counts = np.zeros(len(self.coefficients))
        counts[compound * self.ages : compound * self.ages + laps] = 1.0
        return counts

    def seconds(self, counts: Floats) -> Floats:
        """What some sums of coefficients, `counts` (n, k), come to, s."""
        return counts @ self.coefficients

    def half_width(self, counts: Floats, confidence: float = 0.95) -> Floats:
        """Half the widths (n,) of confidence intervals of some sums of coefficients, `counts` (n, k), s."""
        variance = np.einsum("nk,kl,nl->n", counts, self.covariance, counts)
        wide = float(stdtrit(self.freedom, (1 + confidence) / 2))
        return np.asarray(wide * np.sqrt(np.maximum(variance, 0.0)))


FUEL, START, STOP = -3, -2, -1
"""Indices of the last coefficients."""


def fit(laps: pl.DataFrame) -> LapModel:
    """The model of some practice laps (LAPS of `nathlon.lab.stints.practice`).

    Raises:
        InputError: if there are too few laps to tell how sure anything is.
    """
    compounds = tuple(laps["compound"].unique(maintain_order=True))
    ages = int(laps["age"].max())  # type: ignore[arg-type]
    lasted = tuple(int(laps.filter(compound=compound)["age"].max()) for compound in compounds)  # type: ignore[arg-type]
    rows = np.zeros((laps.height, len(compounds) * ages + 3))
    for row, lap in zip(rows, laps.iter_rows(named=True), strict=True):
        first = compounds.index(lap["compound"]) * ages
        row[first + lap["age"] - 1] += 1.0
        row[FUEL], row[START] = lap["fuel_kg"], float(lap["start"])
        if lap["stops"]:
            row[first] += 1.0
            row[STOP] = 1.0
    freedom = laps.height - int(np.linalg.matrix_rank(rows))
    if freedom < 2:
        raise InputError(f"{laps.height} practice laps, expected at least two runs on each compound")
    inverse: Floats = np.linalg.pinv(rows.T @ rows, hermitian=True).astype(np.float64)
    lap_s = laps["lap_s"].to_numpy()
    found: Floats = inverse @ rows.T @ lap_s
    variance = float(((lap_s - rows @ found) ** 2).sum()) / freedom
    used_kg, wear = (_means(laps, column, compounds, ages) for column in ("used_kg", "wear"))
    return LapModel(compounds, ages, lasted, found, variance * inverse, freedom, used_kg, wear)


def stint_model(model: LapModel) -> StintModel:
    """The model as a composite carries it.

    Of new tyres only the sums with a start or a stop are known. There they are taken to be faster than those
    a lap old by as much as these are than those of two laps, in the mean of the compounds.
    """
    fuel_s_kg, start_s, stop_s = model.coefficients[[FUEL, START, STOP]].tolist()
    seconds = model.coefficients[: len(model.compounds) * model.ages].reshape(-1, model.ages).copy()
    known = seconds[np.array(model.lasted) > 2]
    if len(known):
        more_s = float((2.0 * known[:, 1] - known[:, 2] - known[:, 0]).mean())
        seconds[:, 0] += more_s
        start_s, stop_s = start_s - more_s, stop_s - more_s
    # Means of some runs may fall where tyres hardly wear.
    wear = np.maximum.accumulate(model.wear, axis=1)
    compounds = tuple(
        CompoundLaps(
            name=name,
            lap_s=_digits(seconds[row, :lasted]),
            used_kg=_digits(model.used_kg[row, :lasted]),
            wear=_digits(wear[row, :lasted]),
        )
        for row, (name, lasted) in enumerate(zip(model.compounds, model.lasted, strict=True))
    )
    return StintModel(
        fuel_s_kg=round(fuel_s_kg, 5),
        start_s=round(start_s, 3),
        stop_s=round(stop_s, 3),
        compound=compounds,
    )


def _digits(numbers: Floats) -> tuple[float, ...]:
    return tuple(np.round(numbers, 4).tolist())


def _means(laps: pl.DataFrame, column: str, compounds: tuple[str, ...], ages: int) -> Floats:
    """Mean of a column by compound and age; of laps that were not driven alone, that of the age before."""
    found = laps.filter(~pl.col("stops")).group_by("compound", "age").agg(pl.col(column).mean())
    means = np.full((len(compounds), ages), np.nan)
    for compound, age, mean in found.iter_rows():
        means[compounds.index(compound), age - 1] = mean
    for age in range(1, ages):
        means[:, age] = np.where(np.isnan(means[:, age]), means[:, age - 1], means[:, age])
    return means
