"""Styles of generated circuits: what bends they have, how wide the road is, and what stands beside it."""

from __future__ import annotations

from typing import NamedTuple

from nathlon.sim.track import Runoff
from nathlon.sim.track.layout import Roadside

Span = tuple[float, float]
"""Least and largest."""


class Shape(NamedTuple):
    """A kind of bend.

    Attributes:
        weight: how often it comes, beside the others of a style.
        turn_degrees: of each bend.
        radius_m: of each arc; even in its logarithm.
        bends: how many follow each other, left and right in turn.
        link_m: straight between two of them.
    """

    weight: float
    turn_degrees: Span
    radius_m: Span
    bends: int = 1
    link_m: Span = (0.0, 0.0)


class Style(NamedTuple):
    """What circuits of a kind have in common; every quantity is drawn from its span.

    Attributes:
        shapes: the bends.
        length_m: of the lap.
        straight_share: of the lap.
        start_m: the straight with the start line, as long as a grid of 20 cars and more.
        width_m: of the road.
        relief_m: between the lowest and the highest place, where slopes allow it.
        crossfall_degrees: of bends, + is towards the inside.
        banked_share: of bends that are banked in earnest.
        roadside: kerbs, run-off and walls; how wide the run-off is, varies by a third.
        runoffs: surfaces of the run-off, one for each circuit.
    """

    shapes: tuple[Shape, ...]
    length_m: Span
    straight_share: Span
    start_m: Span
    width_m: Span
    relief_m: Span
    crossfall_degrees: Span
    banked_share: float
    roadside: Roadside
    runoffs: tuple[Runoff, ...]


GRAND_PRIX = Style(
    shapes=(
        Shape(0.12, (135, 185), (14, 34)),  # hairpin
        Shape(0.36, (60, 125), (28, 90)),
        Shape(0.20, (30, 90), (110, 280)),  # sweep
        Shape(0.12, (8, 25), (200, 500)),  # kink
        Shape(0.10, (45, 85), (20, 45), 2, (5, 25)),  # chicane
        Shape(0.10, (35, 70), (60, 150), 3, (0, 30)),  # esses
    ),
    length_m=(4200.0, 6600.0),
    straight_share=(0.35, 0.55),
    start_m=(420.0, 1000.0),
    width_m=(11.5, 15.0),
    relief_m=(5.0, 80.0),
    crossfall_degrees=(-1.0, 4.0),
    banked_share=0.06,
    roadside=Roadside(runoff_m=7.0, bend_runoff_m=28.0, kerb_m=1.5, beside_kerb_m=0.8, gravel_m=10.0),
    runoffs=("grass", "grass", "tarmac"),
)
STREET = Style(
    shapes=(
        Shape(0.07, (145, 185), (11, 17)),
        Shape(0.53, (65, 110), (14, 30)),  # from street to street
        Shape(0.12, (20, 65), (60, 180)),
        Shape(0.13, (8, 25), (100, 400)),
        Shape(0.15, (40, 75), (14, 30), 2, (5, 25)),
    ),
    length_m=(3000.0, 6200.0),
    straight_share=(0.45, 0.65),
    start_m=(330.0, 700.0),
    width_m=(9.0, 12.5),
    relief_m=(0.0, 45.0),
    crossfall_degrees=(-2.0, 2.0),
    banked_share=0.0,
    roadside=Roadside(runoff_m=1.3, bend_runoff_m=3.0, kerb_m=0.9, beside_kerb_m=0.2),
    runoffs=("tarmac",),
)
NATIONAL = Style(
    shapes=(
        Shape(0.14, (135, 185), (14, 28)),
        Shape(0.42, (50, 125), (22, 65)),
        Shape(0.20, (25, 85), (70, 180)),
        Shape(0.12, (8, 25), (150, 400)),
        Shape(0.05, (40, 75), (16, 35), 2, (5, 20)),
        Shape(0.07, (30, 65), (35, 90), 3, (0, 20)),
    ),
    length_m=(1900.0, 3900.0),
    straight_share=(0.35, 0.5),
    start_m=(330.0, 600.0),
    width_m=(9.0, 12.0),
    relief_m=(3.0, 60.0),
    crossfall_degrees=(-1.5, 4.0),
    banked_share=0.04,
    roadside=Roadside(runoff_m=4.0, bend_runoff_m=14.0, kerb_m=1.0, beside_kerb_m=0.8, gravel_m=8.0),
    runoffs=("grass",),
)
STYLES = {"grand-prix": GRAND_PRIX, "street": STREET, "national": NATIONAL}
