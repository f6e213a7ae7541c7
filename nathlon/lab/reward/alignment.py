"""Preferences between clips, and how well a formula agrees with them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Literal, NamedTuple

import numpy as np

from nathlon.lab.reward.clips import Clips
from nathlon.sim.data_file import Section
from nathlon.sim.expressions import Expression

Clip = tuple[str, int]
"""Who drives, and from which start."""


class Preference(Section):
    """What a judge thinks of two clips.

    Attributes:
        first, second: who drive.
        start: from which start both do.
        better: 1 if the first drives better, -1 if the second does, 0 if neither.
        remark: what the judge says.
    """

    first: str
    second: str
    start: int
    better: Literal[-1, 0, 1]
    remark: str = ""


class Alignment(NamedTuple):
    """How well a formula agrees with preferences.

    Attributes:
        tac: the trajectory alignment coefficient, Kendall's tau-a, from -1 to 1: of all pairs of clips the
            share that it orders as the judge did, less the share that it orders the other way round.
        error: standard error of it.
        pairs: how many preferences there were.
    """

    tac: float
    error: float
    pairs: int


def returns(formula: Expression, clips: Clips) -> np.ndarray:
    """Sums of a formula over the steps that were driven, (starts,) float64."""
    values = np.broadcast_to(
        formula({name: clips.readings[name] for name in formula.names}), clips.driven.shape
    )
    return np.asarray(np.where(clips.driven, values, 0.0).sum(axis=1))


def align(formula: Expression, clips: Mapping[str, Clips], preferences: Iterable[Preference]) -> Alignment:
    """How well a formula agrees with preferences.

    Args:
        formula: a reward of one step.
        clips: by driver.
        preferences: between some of them.
    """
    value = {name: returns(formula, one) for name, one in clips.items()}
    orders = [
        (np.sign(value[one.first][one.start] - value[one.second][one.start]), one.better)
        for one in preferences
    ]
    return tau_a(orders)


def tau_a(orders: Iterable[tuple[float, float]]) -> Alignment:
    """Kendall's tau-a of pairs of signs: ties of either count as neither agreeing nor disagreeing."""
    products = np.array([found * wanted for found, wanted in orders], np.float64)
    if not len(products):
        return Alignment(0.0, math.inf, 0)
    spread = float(products.std()) / math.sqrt(len(products))
    return Alignment(float(products.mean()), spread, len(products))
