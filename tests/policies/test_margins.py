"""The room for a car's line, and what it lacks where the car stands askew to a wall."""

from __future__ import annotations

import numpy as np
import pytest

from nathlon.policies.driver.envelope import envelope
from nathlon.policies.driver.margins import HALF_LENGTH_M, HALF_WIDTH_M, WALL_CLEAR_M, lacking, less, room
from nathlon.policies.driver.racing_line import minimum_time
from tests.support.driving import GT3, STRAIGHT_M, circle, road, stadium

RADIUS, WALL = 60.0, 8.0


@pytest.mark.parametrize("offset", [0.0, 6.4, 6.8, -6.4, -6.9])
def test_corners_on_a_circle_are_as_near_its_walls_as_geometry_has_it(offset: float) -> None:
    track = circle(RADIUS, half_width=6.0, wall=WALL)
    left, right = lacking(track, np.full(len(track.table), offset))
    inner = RADIUS - offset - HALF_WIDTH_M  # the inner corners are further round, and so further out
    outer = RADIUS - offset + HALF_WIDTH_M
    nearest_left = np.hypot(inner, HALF_LENGTH_M) - (RADIUS - WALL)
    nearest_right = (RADIUS + WALL) - np.hypot(outer, HALF_LENGTH_M)
    np.testing.assert_allclose(left, max(WALL_CLEAR_M - nearest_left, 0.0), atol=0.02)
    np.testing.assert_allclose(right, max(WALL_CLEAR_M - nearest_right, 0.0), atol=0.02)


def test_a_car_askew_on_a_straight_reaches_further_aside() -> None:
    track = stadium(half_width=20.0, wall=8.0)
    rows = np.arange(len(track.table)) * track.spacing
    angle = 0.2
    middle = STRAIGHT_M / 2
    offset = np.clip((rows - middle) * np.tan(angle), -7.0, 7.0)
    left, right = lacking(track, offset)
    reach = HALF_LENGTH_M * np.sin(angle) + HALF_WIDTH_M * np.cos(angle)
    slanted = np.abs(rows - middle) * np.tan(angle) < 6.5
    for side, found in ((1.0, left), (-1.0, right)):
        expected = np.maximum(side * offset + reach - 8.0 + WALL_CLEAR_M, 0.0)
        np.testing.assert_allclose(found[slanted], expected[slanted], atol=0.02)


def test_room_is_taken_around_what_lacks_it_and_half_of_it_stays() -> None:
    track = circle(RADIUS)
    space = np.full(len(track.table), 4.0)
    missing = np.zeros(len(track.table))
    missing[0], missing[100] = 0.5, 9.0
    left = less(track, space, missing)
    assert left[0] == left[1] == left[-1] == 3.5
    assert left[100] == 2.0
    assert left[50] == 4.0
    assert set(left.tolist()) == {2.0, 3.5, 4.0}


def square(side: float, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Points every 2 m of a square with round corners."""
    along, turn = np.arange(0.0, side, 2.0), np.arange(0.0, 0.5 * np.pi, 2.0 / radius)
    x, y, at_x, at_y = [], [], 0.0, 0.0
    for heading in 0.5 * np.pi * np.arange(4):
        cosine, sine = np.cos(heading), np.sin(heading)
        x += [at_x + along * cosine, at_x + side * cosine + radius * (np.sin(heading + turn) - sine)]
        y += [at_y + along * sine, at_y + side * sine - radius * (np.cos(heading + turn) - cosine)]
        at_x += side * cosine + radius * (cosine - sine)
        at_y += side * sine + radius * (sine + cosine)
    return np.concatenate(x), np.concatenate(y)


def test_the_line_keeps_the_whole_car_off_walls_at_the_inside_of_tight_corners() -> None:
    track = road(*square(200.0, 9.0), half_width=7.0, wall=7.0)
    line = minimum_time(track, envelope(GT3), 0.97)
    left, right = lacking(track, line)
    assert max(left.max(), right.max()) < 1e-9
    assert (line <= room(track)[0] + 0.05).all()
