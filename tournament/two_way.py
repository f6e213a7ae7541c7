"""Which policy with which strategy: a two-way layout, in which the effect of one is told from the other's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import polars as pl
from scipy.special import stdtrit

from nathlon.arena.results import STRATEGIES
from nathlon.arena.statistics import Floats
from nathlon.tournament.evidence import UNIT, in_units


class CrossedEntrant(NamedTuple):
    """A policy with a strategy, by their labels."""

    policy: str
    strategy: str


def crossed(cells: Mapping[str, CrossedEntrant]) -> dict[str, CrossedEntrant]:
    """Those entrants that make up a layout: of policies that were entered once with every strategy.

    Args:
        cells: of the entrants, by id.

    Returns:
        empty where there are not two strategies, or no policy has them all.
    """
    strategies = {cell.strategy for cell in cells.values()}
    of = {policy: [c.strategy for c in cells.values() if c.policy == policy] for policy, _ in cells.values()}
    whole = {policy for policy, own in of.items() if sorted(own) == sorted(strategies)}
    return {e: cell for e, cell in cells.items() if len(strategies) > 1 and cell.policy in whole}


def two_way(
    results: pl.DataFrame, cells: Mapping[str, CrossedEntrant], confidence: float = 0.95
) -> pl.DataFrame:
    """STRATEGIES of the RESULTS of a free-for-all.

    A unit has one value for every cell, points of one of its cars, a race: what a unit's seed does to all
    cancels in every effect. Intervals are Student's, over units; none where there is one unit only.

    Args:
        results: RESULTS.
        cells: what entrants are, by id; see `crossed`.
        confidence: of each interval.
    """
    layout = crossed(cells)
    own = in_units(results).filter(pl.col("entrant").is_in(list(layout)))
    races = own.group_by(*UNIT, "race", "entrant").agg(pl.col("points").mean())
    seen = races.group_by(*UNIT, "entrant").agg(pl.col("points").mean())
    units = seen.filter(pl.len().over(UNIT) == len(layout))
    if units.is_empty():
        return pl.DataFrame(schema=STRATEGIES)
    policies = list(dict.fromkeys(cell.policy for cell in layout.values()))
    strategies = list(dict.fromkeys(cell.strategy for cell in layout.values()))
    ids = {cell: entrant for entrant, cell in layout.items()}
    order = [ids[CrossedEntrant(policy, strategy)] for policy in policies for strategy in strategies]
    rank = pl.col("entrant").replace_strict({entrant: i for i, entrant in enumerate(order)})
    points = units.sort(*UNIT, rank)["points"].to_numpy()
    table = points.reshape(-1, len(policies), len(strategies))
    whole = table.mean(axis=(1, 2), keepdims=True)
    by_policy, by_strategy = table.mean(axis=2, keepdims=True), table.mean(axis=1, keepdims=True)
    left = table - by_policy - by_strategy + whole
    rows: list[tuple[str, str, str | None, Floats, Floats]] = []
    for i, policy in enumerate(policies):
        rows.append((policy, "", None, by_policy[:, i, 0], (by_policy - whole)[:, i, 0]))
    for j, strategy in enumerate(strategies):
        rows.append(("", strategy, None, by_strategy[:, 0, j], (by_strategy - whole)[:, 0, j]))
    for i, policy in enumerate(policies):
        for j, strategy in enumerate(strategies):
            rows.append(
                (policy, strategy, ids[CrossedEntrant(policy, strategy)], table[:, i, j], left[:, i, j])
            )
    return pl.DataFrame(
        [
            (*names, *_interval(mean, confidence), *_interval(effect, confidence), len(table))
            for *names, mean, effect in rows
        ],
        schema=STRATEGIES,
        orient="row",
    )


def _interval(values: Floats, confidence: float) -> tuple[float, float | None, float | None]:
    """Mean of values over units, (units,), and Student's interval of it."""
    mean, count = float(values.mean()), len(values)
    if count < 2:
        return mean, None, None
    half = float(stdtrit(count - 1, (1 + confidence) / 2) * values.std(ddof=1) / np.sqrt(count))
    return mean, mean - half, mean + half
