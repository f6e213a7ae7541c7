"""Heights, banking and widths of a generated road, drawn by lot within what cars can drive."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from nathlon.sim.track.layout import runs
from nathlon.sim.track.styles import Style

WAVES, WAVELENGTH_M = 24, (500.0, 4000.0)
"""Of the ground: plane waves, the longer the higher."""
GRADED_M = 40.0
"""Hills shorter than a few times this are dug away."""
STEEPEST, LIGHTEST = 0.09, 4.0
"""Largest slope, and the most that a crest takes from a car's weight, or a dip adds, m/s^2."""
FASTEST_M_S, CORNERING = 85.0, 30.0
"""Speeds at which crests are taken: on straights, and by lateral acceleration (m/s^2) in bends."""
BRAKING_M = 80.0

BANKED_DEGREES, BANKED_RADIUS_M = (6.0, 12.0), 60.0
"""Of bends banked in earnest, and how wide they are at least."""
RAMP_M, MOST_TWIST = 12.0, 0.002
"""Over which banking grows (standard deviation), and the most it changes by, 1/m."""
WIDTH_WAVE_M, WIDTH_SHARE = 400.0, 0.05
LEAST_BEND = 1e-9
"""Curvature of no account, 1/m."""


def draw_heights(
    position: NDArray[np.float64],
    curvature: NDArray[np.float64],
    spacing: float,
    relief: float,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Heights of a road over hilly ground, so that neighbouring parts of the lap lie about as high.

    Args:
        position, curvature: (n, 2) in m and (n,) in 1/m, of the closed centre line.
        spacing: of its rows, m.
        relief: between the lowest and the highest place, m; less where the road would be too steep.
        rng: source of all lots.

    Returns:
        (n,) m, the first 0.
    """
    shortest, longest = np.log(WAVELENGTH_M)
    length = np.exp(rng.uniform(shortest, longest, WAVES))
    direction, phase = rng.uniform(0.0, 2.0 * np.pi, (2, WAVES))
    along = position[:, :1] * np.cos(direction) + position[:, 1:] * np.sin(direction)
    ground = np.cos(2.0 * np.pi * along / length + phase) @ length
    ground = gaussian_filter1d(ground, GRADED_M / spacing, mode="wrap")
    slope = (np.roll(ground, -1) - ground) / spacing
    crest = (slope - np.roll(slope, 1)) / spacing
    sharpest = maximum_filter1d(np.abs(curvature), round(BRAKING_M / spacing), mode="wrap")
    speed_squared = np.minimum(FASTEST_M_S**2, CORNERING / np.maximum(sharpest, LEAST_BEND))
    scale = min(
        relief / np.ptp(ground),
        STEEPEST / np.abs(slope).max(),
        LIGHTEST / (np.abs(crest) * speed_squared).max(),
    )
    return np.asarray(scale * (ground - ground[0]))


def draw_bank(
    curvature: NDArray[np.float64], spacing: float, style: Style, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Angle of banking of a closed road, rad, + is left side up, (n,); proportional to a bend's curvature."""
    bank = np.zeros(len(curvature))
    for first, last in runs(np.abs(curvature) > LEAST_BEND):
        inside = curvature[first:last]
        sharpest = np.abs(inside).max()
        banked = rng.uniform() < style.banked_share and sharpest < 1.0 / BANKED_RADIUS_M
        angle = np.radians(rng.uniform(*(BANKED_DEGREES if banked else style.crossfall_degrees)))
        bank[first:last] = -inside / sharpest * angle
    bank = gaussian_filter1d(bank, RAMP_M / spacing, mode="wrap")
    twist = np.abs(np.roll(bank, -1) - bank).max() / spacing
    return np.asarray(bank * min(1.0, MOST_TWIST / max(twist, LEAST_BEND)))


def draw_width(rows: int, spacing: float, width: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """From the centre line to an edge of a road about as wide as given, m, (n,); wavy along the lap."""
    noise = gaussian_filter1d(rng.normal(0.0, 1.0, rows), WIDTH_WAVE_M / 6.0 / spacing, mode="wrap")
    return np.asarray(0.5 * width * (1.0 + WIDTH_SHARE * np.clip(noise / noise.std(), -2.0, 2.0)))
