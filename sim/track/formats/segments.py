"""Circuits made of straights and arcs: TORCS and Speed Dreams tracks, fastest-lap's simple ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from nathlon.sim.errors import InputError
from nathlon.sim.track.formats.markup import place
from nathlon.sim.track.formats.outline import METRES, CircuitLine, known_heights, to_number

STEP_M = 2.0
LONGEST_M = 100_000.0
OPEN_SHARE = 0.02
"""Of the lap: what rounded segments may leave between end and start. It is spread over the lap."""
TURNS = {"str": 0.0, "straight": 0.0, "lft": 1.0, "left": 1.0, "rgt": -1.0, "right": -1.0}
EXPECTED_TORCS = "expected a section 'Main Track' with 'Track Segments' of type str, lft and rgt"
EXPECTED_ARCS = "expected straight and corner elements"


class Piece(NamedTuple):
    """A straight or a bend.

    Attributes:
        length: m.
        curvature: at start and end, 1/m, + is left; between them the radius changes evenly.
        heights: at start and end, m.
        banks: at start and end, rad, + where the left is higher.
    """

    length: float
    curvature: tuple[float, float]
    place: str
    heights: tuple[float, float] = (0.0, 0.0)
    banks: tuple[float, float] = (0.0, 0.0)


def read_torcs(root: Element) -> CircuitLine:
    """Read the segments of a track file, with its heights and banking.

    Raises:
        InputError: if a segment lacks what it needs, or they do not lead round.
    """
    main = _section(root, "Main Track")
    segments = None if main is None else _section(main, "Track Segments", "segments")
    if main is None or segments is None:
        raise InputError(f"{place(root)}: {EXPECTED_TORCS}")
    width = _value(main, "width") if _has(main, "width") else None
    pieces: list[Piece] = []
    # Each side goes on where the segment before has left it.
    ends = (0.0, 0.0)
    for segment in segments.iterfind("section"):
        length, curvature = _shape(segment)
        heights, banks, ends = _rise(segment, ends, length, width or 10.0)
        pieces.append(Piece(length, curvature, place(segment), heights, banks))
    return _outline("a TORCS track", pieces, width)


def read_arcs(root: Element) -> CircuitLine:
    """Read a track of fastest-lap that is given by straights and corners.

    Raises:
        InputError: if a corner lacks radius, sweep or direction, or they do not lead round.
    """
    pieces = []
    for element in root:
        if element.tag == "straight":
            if element.get("length") is not None:
                length = to_number(element.get("length"), place(element), "length")
                pieces.append(Piece(length, (0.0, 0.0), place(element)))
        elif element.tag == "corner":
            radius, sweep = (
                to_number(element.get(name), place(element), name) for name in ("radius", "sweep")
            )
            turn = _turn(element.get("direction"), place(element), "direction") / _not_zero(radius, element)
            pieces.append(Piece(radius * sweep, (turn, turn), place(element)))
        else:
            raise InputError(f"{place(element)}: <{element.tag[:40]}>, {EXPECTED_ARCS}")
    width = to_number(root.get("width"), place(root), "width") if root.get("width") is not None else None
    if any(element.tag == "straight" and element.get("length") is None for element in root):
        pieces = _closed_by_straight(pieces)
    return _outline("straights and corners of fastest-lap", pieces, width or None)


def _closed_by_straight(pieces: list[Piece]) -> list[Piece]:
    """A last straight without a length is as long as the lap needs."""
    if not pieces:
        return pieces
    end, _ = _lay(pieces)
    gap = float(np.hypot(*end[-1]))
    return [*pieces, Piece(gap, (0.0, 0.0), pieces[-1].place)] if gap > STEP_M else pieces


def _outline(dialect: str, pieces: Sequence[Piece], width: float | None) -> CircuitLine:
    if not pieces:
        raise InputError(f"no segments, {EXPECTED_TORCS} (or {EXPECTED_ARCS})")
    for piece in pieces:
        if not 0.0 < piece.length < LONGEST_M:
            raise InputError(f"{piece.place}: a segment of {piece.length:g} m, expected a positive length")
    total = sum(piece.length for piece in pieces)
    if total > LONGEST_M:
        raise InputError(f"segments of {total:,.0f} m in all, expected at most {LONGEST_M:,.0f} m")
    line, at = _lay(pieces)
    gap = float(np.hypot(*line[-1]))
    if gap > OPEN_SHARE * total:
        raise InputError(
            f"{pieces[-1].place}: the last segment ends {gap:.0f} m from the start of the first, "
            "expected segments that lead round"
        )
    line = line[:-1] - line[-1] * (at[:-1, None] / total)
    stops = np.cumsum([0.0, *(piece.length for piece in pieces)])
    height = np.array([pieces[0].heights[0], *(piece.heights[1] for piece in pieces)])
    height -= (height[-1] - height[0]) * stops / total
    bank = np.interp(at[:-1], stops, [pieces[0].banks[0], *(piece.banks[1] for piece in pieces)])
    which = np.searchsorted(stops, at[:-1], side="right") - 1
    half = None if width is None else np.full(len(line), width / 2.0)
    return CircuitLine(
        dialect,
        line,
        [pieces[min(int(index), len(pieces) - 1)].place for index in which],
        right=half,
        left=half,
        height=known_heights(PchipInterpolator(stops, height)(at[:-1])),
        bank=bank if bank.any() else None,
        notes=(f"its ends lie {gap:.1f} m apart: spread over the lap",) if gap > 0.1 else (),
    )


def _lay(pieces: Sequence[Piece]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points of pieces in a row to their end, (n + 1, 2), and how far along they lie, (n + 1,)."""
    lengths, turns = [], []
    for length, (first, last), *_ in pieces:
        steps = max(1, math.ceil(length / STEP_M))
        # The radius changes evenly; along a straight the curvature is none.
        share = (np.arange(steps) + 0.5) / steps
        bends = (
            np.full(steps, first)
            if first == last
            else 1.0 / (1.0 / first + (1.0 / last - 1.0 / first) * share)
        )
        lengths.append(np.full(steps, length / steps))
        turns.append(bends * (length / steps))
    step, turn = np.concatenate(lengths), np.concatenate(turns)
    heading = np.cumsum(turn) - turn / 2
    chord = step * np.sinc(turn / (2 * np.pi))
    moves = np.stack([chord * np.cos(heading), chord * np.sin(heading)], axis=1)
    return np.vstack([[0.0, 0.0], np.cumsum(moves, axis=0)]), np.concatenate([[0.0], np.cumsum(step)])


def _shape(segment: Element) -> tuple[float, tuple[float, float]]:
    """Length of a segment, m, and curvature at its start and end, 1/m."""
    turn = _turn(_text(segment, "type"), place(segment), "type")
    if turn == 0.0:
        return _value(segment, "lg"), (0.0, 0.0)
    arc, first = abs(_value(segment, "arc")), _not_zero(_value(segment, "radius"), segment)
    last = _not_zero(_value(segment, "end radius"), segment) if _has(segment, "end radius") else first
    # So long that an evenly changing radius turns by the arc.
    even = abs(first - last) < 1e-6 * first
    length = arc * (first if even else (last - first) / math.log(last / first))
    return length, (turn / first, turn / (first if even else last))


def _rise(
    segment: Element, before: tuple[float, float], length: float, width: float
) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
    """Heights and banks at both ends of a segment, and how high its left and right sides end, m."""

    def side(end: str, left: float, right: float) -> tuple[float, float, float]:
        """Height, m, and bank, rad, at an end, and how far the left side rises above the middle, m."""
        if _has(segment, f"z {end}"):
            left = right = _value(segment, f"z {end}")
        else:
            left = _value(segment, f"z {end} left") if _has(segment, f"z {end} left") else left
            right = _value(segment, f"z {end} right") if _has(segment, f"z {end} right") else right
        bank = math.atan2(left - right, width)
        if _has(segment, f"banking {end}"):
            bank = _value(segment, f"banking {end}")
        return (left + right) / 2.0, bank, math.tan(bank) * width / 2.0

    start, start_bank, start_lift = side("start", *before)
    end, end_bank, end_lift = side("end", start + start_lift, start - start_lift)
    if _has(segment, "grade") and not _has(segment, "z end"):
        end = start + length * _value(segment, "grade")
    return (start, end), (start_bank, end_bank), (end + end_lift, end - end_lift)


def _section(root: Element, *names: str) -> Element | None:
    return next((found for found in root.iter("section") if found.get("name") in names), None)


def _attribute(segment: Element, name: str) -> Element | None:
    return next(
        (found for found in segment if found.tag.startswith("att") and found.get("name") == name), None
    )


def _has(segment: Element, name: str) -> bool:
    return _attribute(segment, name) is not None


def _text(segment: Element, name: str) -> str | None:
    found = _attribute(segment, name)
    return None if found is None else found.get("val")


def _value(segment: Element, name: str) -> float:
    """A number of a segment, m or rad.

    Raises:
        InputError: if it has none of that name.
    """
    found = _attribute(segment, name)
    if found is None:
        raise InputError(f"{place(segment)}: the segment has no {name!r}, {EXPECTED_TORCS}")
    value = to_number(found.get("val"), place(found), name)
    unit = found.get("unit", "")
    return math.radians(value) if unit.startswith("deg") else value * {**METRES, "%": 0.01}.get(unit, 1.0)


def _turn(text: str | None, where: str, field: str) -> float:
    if text not in TURNS:
        raise InputError(f"{where}: {field} is {(text or '')[:40]!r}, expected one of {', '.join(TURNS)}")
    return TURNS[text]


def _not_zero(radius: float, element: Element) -> float:
    if not radius > 0.0:
        raise InputError(f"{place(element)}: radius is {radius:g}, expected a positive number")
    return radius
