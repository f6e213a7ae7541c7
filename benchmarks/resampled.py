"""Runs that race nothing: their matches are drawn from races that a folder holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import polars as pl
from numpy.typing import NDArray

from nathlon.arena.match import Match
from nathlon.arena.results import RESULTS
from nathlon.selection.run import Run


class Units:
    """Raced units of evidence: some RESULTS in which every unit has as many rows as the others.

    Attributes:
        races: of a unit: two of a mirrored pair, one of a test.
    """

    def __init__(self, results: pl.DataFrame, races: int) -> None:
        """Units of so many races, which come one after the other in their match.

        Raises:
            ValueError: if they are not of one size.
        """
        self.races = races
        self._rows = results.sort("match", "race", "car")
        sizes = self._rows.group_by("match", pl.col("race") // races).len()["len"].unique()
        if len(sizes) != 1:
            raise ValueError(f"units of {sorted(sizes)} rows, expected one size")
        self._size = int(sizes[0])

    def __len__(self) -> int:
        return len(self._rows) // self._size

    def take(self, match: Match, numbers: NDArray[np.int64]) -> pl.DataFrame:
        """RESULTS of a match made of these units (N,), by their numbers, with its seeds."""
        rows = (numbers[:, None] * self._size + np.arange(self._size)).ravel()
        cars = self._size // self.races
        race = np.arange(len(match.races))
        return self._rows[rows].with_columns(
            race=pl.Series(np.repeat(race, cars)),
            seed=pl.Series(np.repeat([each.seed for each in match.races], cars)),
        )

    def drawn(self, match: Match, rng: np.random.Generator) -> pl.DataFrame:
        """RESULTS of a match whose units are drawn with replacement."""
        return self.take(match, rng.integers(len(self), size=len(match.races) // self.races))


@dataclass(kw_only=True)
class Resampled(Run):
    """A run whose matches are drawn; what a stage asks for again is what it was.

    Attributes:
        draw: RESULTS of a match.
    """

    draw: Callable[[Match], pl.DataFrame]
    _known: dict[Match, pl.DataFrame] = field(default_factory=dict, init=False)

    def results(self, stage: str, matches: Sequence[Match]) -> pl.DataFrame:
        """RESULTS of all matches in their order."""
        for match in matches:
            if match not in self._known:
                name = pl.lit(f"match {len(self._known)}")
                self._known[match] = self.draw(match).with_columns(match=name)
        return pl.concat([pl.DataFrame(schema=RESULTS), *(self._known[match] for match in matches)])


def resampled(run: Run, number: int, draw: Callable[[Match], pl.DataFrame]) -> Resampled:
    """The `number`th run like another one, with seeds of its own."""
    return Resampled(run.store, run.name, (*run.seeds_from, number), run.pool, _untold, draw=draw)


def _untold(stage: str, done: int, total: int) -> None:
    """Nothing is raced: nobody waits for it."""
