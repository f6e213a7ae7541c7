"""Horizontal alignment of a closed road: straights, clothoids and arcs, as road engineers put them together.

Curvature changes linearly along each piece and has no steps between pieces, so that a car can follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)
"""Exact to rounding for pieces that turn by up to a full circle."""
WORST_CONDITION = 1e9
"""Beyond, all straights that are free run the same way."""


class Clothoid(NamedTuple):
    """A part of the road with curvature linear in the distance.

    Attributes:
        length: m.
        enter, leave: curvature at its ends, 1/m, + is left.
    """

    length: float
    enter: float
    leave: float

    @property
    def turn(self) -> float:
        """Change of direction, rad, + is left."""
        return 0.5 * (self.enter + self.leave) * self.length


def straight(length: float) -> Clothoid:
    """A straight of some metres."""
    return Clothoid(length, 0.0, 0.0)


def bend(turn: float, radius: float, transition: float) -> tuple[Clothoid, Clothoid, Clothoid]:
    """A clothoid, an arc and a clothoid.

    Args:
        turn: of all three, rad, + is left.
        radius: of the arc, m.
        transition: share of the turn that the two clothoids take, in (0, 1].
    """
    curvature = np.sign(turn) / radius
    clothoid = transition * abs(turn) * radius
    arc = (1.0 - transition) * abs(turn) * radius
    return (
        Clothoid(clothoid, 0.0, curvature),
        Clothoid(arc, curvature, curvature),
        Clothoid(clothoid, curvature, 0.0),
    )


def turn_of(pieces: Sequence[Clothoid]) -> float:
    """Change of direction over some pieces, rad, + is left."""
    return sum(piece.turn for piece in pieces)


def length_of(pieces: Sequence[Clothoid]) -> float:
    """Length of some pieces, m."""
    return sum(piece.length for piece in pieces)


def displacement(pieces: Sequence[Clothoid]) -> NDArray[np.float64]:
    """From the beginning of some pieces to their end, where they begin eastward; (2,), m."""
    length, enter, leave = np.array(pieces).T
    turns = 0.5 * (enter + leave) * length
    share = 0.5 * (NODES + 1.0)
    # In each piece the direction is a parabola of the distance.
    within = length[:, None] * (enter[:, None] * share + 0.5 * (leave - enter)[:, None] * share**2)
    direction = (np.cumsum(turns) - turns)[:, None] + within
    half = 0.5 * length
    return np.array([half @ (np.cos(direction) @ WEIGHTS), half @ (np.sin(direction) @ WEIGHTS)])


def close(
    bends: Sequence[Sequence[Clothoid]],
    wanted: NDArray[np.float64],
    least: NDArray[np.float64],
    length: float,
) -> NDArray[np.float64] | None:
    """Lengths of the straights with which a lap of straights and bends in turn ends where it began.

    Directions do not depend on the lengths, so closure is linear in them. Of all that close, these are
    near to the wanted ones, longer ones giving way more; what would be too short is as short as may be.

    Args:
        bends: (n) of pieces; their turns add up to a full circle.
        wanted, least: (n,) lengths, m, of the straight before each bend.
        length: of the lap, m.

    Returns:
        (n,) m; None where none were found.
    """
    heading = np.cumsum([0.0] + [turn_of(pieces) for pieces in bends])[:-1]
    ahead = np.exp(1j * heading)
    bent = ahead @ np.array([complex(*displacement(pieces)) for pieces in bends])
    conditions = np.stack([ahead.real, ahead.imag, np.ones(len(bends))])
    target = np.array([-bent.real, -bent.imag, length - sum(length_of(pieces) for pieces in bends)])
    straights = np.maximum(wanted, least)
    free = np.ones(len(bends), np.bool_)
    while free.sum() >= len(target):
        missing = target - conditions @ straights
        normal = (conditions[:, free] * wanted[free]) @ conditions[:, free].T
        if np.linalg.cond(normal) > WORST_CONDITION:
            return None
        straights[free] += wanted[free] * (conditions[:, free].T @ np.linalg.solve(normal, missing))
        short = straights < least
        if not short.any():
            return straights
        straights[short] = least[short]
        free &= ~short
    return None


def sample(
    pieces: Sequence[Clothoid], distance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The line of some pieces from the origin eastward.

    Args:
        pieces: in turn.
        distance: (n,) m, rising, from 0 to less than their length.

    Returns:
        position (n, 2) in m, heading (n,) in rad and curvature (n,) in 1/m, + is left.
    """
    ends = np.cumsum([piece.length for piece in pieces])
    position, heading, curvature = (
        np.zeros((len(distance), 2)),
        np.zeros(len(distance)),
        np.zeros(len(distance)),
    )
    begin, there, direction = 0.0, np.zeros(2), 0.0
    for piece, end in zip(pieces, ends, strict=True):
        rows = slice(*np.searchsorted(distance, [begin, end]))
        inside = distance[rows] - begin
        position[rows] = there + _along(piece, direction, inside)
        heading[rows] = direction + _turned(piece, inside)
        curvature[rows] = piece.enter + _rate(piece) * inside
        there = there + _along(piece, direction, np.array([piece.length]))[0]
        begin, direction = end, direction + piece.turn
    return position, heading, curvature


def _rate(piece: Clothoid) -> float:
    """Change of curvature a metre, 1/m^2."""
    return (piece.leave - piece.enter) / piece.length if piece.length else 0.0


def _turned(piece: Clothoid, distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Change of direction from the beginning of a piece, rad."""
    return (piece.enter + 0.5 * _rate(piece) * distance) * distance


def _along(piece: Clothoid, heading: float, distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement from the beginning of a piece, (n, 2), m, by Gauss's quadrature."""
    at = 0.5 * distance[:, None] * (NODES + 1.0)
    direction = heading + _turned(piece, at)
    half = 0.5 * distance
    return np.stack([half * (np.cos(direction) @ WEIGHTS), half * (np.sin(direction) @ WEIGHTS)], axis=1)
