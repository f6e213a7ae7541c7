"""Roads of CommonRoad scenarios: lanelets that follow each other round."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.errors import InputError
from nathlon.sim.track.formats.markup import place, text_at
from nathlon.sim.track.formats.outline import CircuitLine, check_most, to_number

MOST_LANELETS = 500
EXPECTED = "expected lanelets that follow each other round, as their successors say"


def read_commonroad(root: Element) -> CircuitLine:
    """Read the lanelets of a scenario; those beside each other in one direction are one road.

    Raises:
        InputError: if no lanelets lead round, or a bound has no points.
    """
    lanelets = {element.get("id", ""): element for element in root.iterfind("lanelet")}
    round_ = _round(lanelets)
    left, right = (
        np.vstack([_bound(_outermost(lanelets, one, side), f"{side}Bound") for one in round_])
        for side in ("left", "right")
    )
    check_most(max(len(left), len(right)), "the lanelets")
    return CircuitLine(
        "lanelets of CommonRoad",
        left,
        [f"left bound, point {number}" for number in range(1, len(left) + 1)],
        right_edge=right,
    )


def _round(lanelets: Mapping[str, Element]) -> list[str]:
    """The lanelets of a lap, by their names, from the first that a lap leads through."""
    if len(lanelets) > MOST_LANELETS:
        raise InputError(f"{len(lanelets):,} lanelets, expected at most {MOST_LANELETS:,}")
    for start in lanelets:
        lap = [start]
        while following := [one for one in _named(lanelets[lap[-1]], "successor") if one in lanelets]:
            if start in following:
                return lap
            onward = [one for one in following if one not in lap]
            if not onward:
                break
            lap.append(onward[0])
    raise InputError(f"{len(lanelets)} lanelets, {EXPECTED}")


def _outermost(lanelets: Mapping[str, Element], name: str, side: str) -> Element:
    """The lanelet farthest to a side in the same direction."""
    seen = {name}
    while True:
        beside = lanelets[name].find(f"adjacent{side.capitalize()}")
        other = "" if beside is None or beside.get("drivingDir", "same") != "same" else beside.get("ref", "")
        if other not in lanelets or other in seen:
            return lanelets[name]
        seen.add(other)
        name = other


def _named(lanelet: Element, tag: str) -> list[str]:
    return [element.get("ref", "") for element in lanelet.iterfind(tag)]


def _bound(lanelet: Element, tag: str) -> NDArray[np.float64]:
    bound = lanelet.find(tag)
    points = [] if bound is None else list(bound.iterfind("point"))
    if not points:
        raise InputError(f"{place(lanelet)}: the lanelet has no <{tag}> with points, {EXPECTED}")
    return np.array(
        [[to_number(text_at(point, axis), place(point), axis) for axis in "xy"] for point in points]
    )
