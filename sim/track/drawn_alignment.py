"""Alignments of circuits drawn by lot: bends of a style, joined by straights so that the lap closes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from nathlon.sim.track.alignment import Clothoid, bend, close, length_of, sample, straight
from nathlon.sim.track.styles import Shape, Style

CLOCKWISE_SHARE = 0.7
"""As of the circuits of the world."""
TRANSITION = (0.35, 0.7)
"""Share of a bend's turn on its clothoids."""
LEAST_STRAIGHT_M = (5.0, 60.0)
UNEVEN = 0.9
"""Of the logarithm of the straights' lengths: one or two are long, most are short."""
ADJUSTED = 0.2
"""Largest share by which bends turn more or less than drawn, so that the lap turns once."""
SIDES_DRAWN = 20
COARSE_M = 8.0


class Bends(NamedTuple):
    """Bends without a straight that is free between them; all turn to the left first.

    Attributes:
        turns, radii, transitions, links: of each, rad, m, share, m to the next.
    """

    turns: NDArray[np.float64]
    radii: NDArray[np.float64]
    transitions: NDArray[np.float64]
    links: NDArray[np.float64]

    def pieces(self, side: float, stretch: float) -> list[Clothoid]:
        """The pieces, turning to a side (+ is left) by a multiple of the turn."""
        found: list[Clothoid] = []
        for turn, radius, transition, link in zip(*self, strict=True):
            found += [*bend(side * stretch * turn, radius, transition), straight(link)]
            side = -side
        return found[:-1]


def draw_alignment(
    style: Style, length: float, apart: float, rng: np.random.Generator
) -> list[Clothoid] | None:
    """One try at an alignment that begins with the longer part of the straight with the start line.

    Args:
        style: of the bends and the straights.
        length: of the lap, m.
        apart: least distance of parts of the lap that do not follow each other, m.
        rng: source of all lots.

    Returns:
        the pieces; None where they close only with straights too short, or come too near to each other.
    """
    drawn = _draw_bends(style, length, rng)
    bends = _turned_once(drawn, rng)
    if bends is None:
        return None
    left = length - sum(length_of(pieces) for pieces in bends)
    wanted = np.exp(rng.normal(0.0, UNEVEN, len(bends)))
    wanted *= left / wanted.sum()
    least = rng.uniform(*LEAST_STRAIGHT_M, len(bends))
    wanted[0], least[0] = max(wanted[0], rng.uniform(*style.start_m)), style.start_m[0]
    straights = close(bends, wanted, least, length)
    if straights is None:
        return None
    pieces = [
        piece for before, those in zip(straights, bends, strict=True) for piece in (straight(before), *those)
    ]
    return pieces if _keeps_apart(pieces, length, apart) else None


def _draw_bends(style: Style, length: float, rng: np.random.Generator) -> list[Bends]:
    """Bends for what the straights leave of a lap."""
    weights = np.array([shape.weight for shape in style.shapes])
    bent = length * (1.0 - rng.uniform(*style.straight_share))
    drawn: list[Bends] = []
    while bent > 0.0:
        shape = style.shapes[rng.choice(len(weights), p=weights / weights.sum())]
        drawn.append(_draw_shape(shape, rng))
        bent -= length_of(drawn[-1].pieces(1.0, 1.0))
    return drawn


def _draw_shape(shape: Shape, rng: np.random.Generator) -> Bends:
    smallest, largest = np.log(shape.radius_m)
    return Bends(
        turns=np.radians(rng.uniform(*shape.turn_degrees, shape.bends)),
        radii=np.exp(rng.uniform(smallest, largest, shape.bends)),
        transitions=rng.uniform(*TRANSITION, shape.bends),
        links=rng.uniform(*shape.link_m, shape.bends),
    )


def _turned_once(drawn: list[Bends], rng: np.random.Generator) -> list[list[Clothoid]] | None:
    """The pieces of all bends, to sides by lot, so that the lap turns once round; None where it cannot."""
    way = -1.0 if rng.uniform() < CLOCKWISE_SHARE else 1.0
    single = np.array([len(bends.turns) == 1 for bends in drawn])
    net = np.array([(bends.turns * (-1.0) ** np.arange(len(bends.turns))).sum() for bends in drawn])
    for _ in range(SIDES_DRAWN):
        sides = rng.choice([-1.0, 1.0], len(drawn))
        missing = way * 2.0 * np.pi - (sides * net).sum()
        share = missing / max(net[single].sum(), 1e-9)
        if abs(share) < ADJUSTED:
            stretch = np.where(single, 1.0 + sides * share, 1.0)
            return [bends.pieces(*how) for bends, *how in zip(drawn, sides, stretch, strict=True)]
    return None


def _keeps_apart(pieces: list[Clothoid], length: float, apart: float) -> bool:
    rows = round(length / COARSE_M)
    position = sample(pieces, np.linspace(0.0, length, rows, endpoint=False))[0]
    one, other = KDTree(position).query_pairs(apart, output_type="ndarray").T
    gap = np.abs(one - other) * (length / rows)
    return not (np.minimum(gap, length - gap) > 3.0 * apart).any()
