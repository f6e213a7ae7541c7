"""Made-up races whose every number is known in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nathlon.arena.race_log import CAR_SAMPLE, Incident, NamedStretch, Outline, RaceLog
from nathlon.sim.track import SURFACES

STRAIGHT_M = 400.0
RADIUS_M = 80.0
LAP_M = 2 * STRAIGHT_M + 2 * np.pi * RADIUS_M
HILL_M, BANK = 12.0, 0.1


def oval_point(
    distance_m: NDArray[np.float64], lateral_m: NDArray[np.float64] | float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """x, y (metres) and heading (radians) beside the centre line of an oval driven counter-clockwise.

    The lap starts in the middle of the south straight, which lies on y = -RADIUS_M.
    """
    along = (distance_m + STRAIGHT_M / 2) % LAP_M
    second_half = along >= LAP_M / 2
    along = np.where(second_half, along - LAP_M / 2, along)
    angle = np.maximum(along - STRAIGHT_M, 0) / RADIUS_M
    radius = RADIUS_M - lateral_m
    x = np.minimum(along, STRAIGHT_M) - STRAIGHT_M / 2 + radius * np.sin(angle)
    y = -radius * np.cos(angle)
    sign = np.where(second_half, -1.0, 1.0)
    heading = np.where(second_half, angle + np.pi, angle)
    return sign * x, sign * y, np.arctan2(np.sin(heading), np.cos(heading))


def oval_height(
    distance_m: NDArray[np.float64], lateral_m: NDArray[np.float64] | float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """z (metres) and slope along the road: one hill a lap, and a bank, the same all round, left side down."""
    angle = 2 * np.pi * distance_m / LAP_M
    height = HILL_M * (1 - np.cos(angle)) / 2 - BANK * lateral_m
    return height, HILL_M * np.pi / LAP_M * np.sin(angle)


def road_axes(
    distance_m: NDArray[np.float64], heading: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors (..., 3) along the oval's road and upright on it."""
    slope = oval_height(distance_m, 0.0)[1]
    cos, sin, level = np.cos(heading), np.sin(heading), np.zeros_like(heading)
    along = np.stack([cos, sin, slope], axis=-1)
    aside = np.stack([-sin, cos, level - BANK], axis=-1)
    up = np.cross(along, aside)
    return along / np.linalg.norm(along, axis=-1)[..., None], up / np.linalg.norm(up, axis=-1)[..., None]


def turned(quaternions: NDArray[np.float64], vector: tuple[float, float, float]) -> NDArray[np.float64]:
    """A vector turned by unit quaternions x, y, z, w, (..., 4)."""
    axis, w = quaternions[..., :3], quaternions[..., 3:]
    return np.array(vector) + 2 * np.cross(axis, np.cross(axis, vector) + w * np.array(vector))


def oval_race(cars: int = 8, duration_s: float = 30.0, seed: int = 1) -> RaceLog:
    """A race at 10 Hz of cars that keep to their lanes on an oval, each somewhat slower than the one before.

    The last car stops half-way; the first two touch once.
    """
    rng = np.random.default_rng(seed)
    time_s = np.arange(round(duration_s * 10)) / 10.0
    top_speed = 55.0 - 0.8 * np.arange(cars) + rng.uniform(-0.3, 0.3, cars)
    lateral = np.where(np.arange(cars) % 2 == 0, 2.5, -2.5)

    driving = np.ones((len(time_s), cars), bool)
    driving[time_s >= duration_s / 2, -1] = False
    speed = np.minimum(12.0 * time_s[:, None], top_speed) * driving
    distance = np.cumsum(speed, axis=0) / 10.0 - 9.0 * np.arange(cars)

    samples = np.zeros((len(time_s), cars), CAR_SAMPLE)
    samples["x_m"], samples["y_m"], samples["yaw_rad"] = oval_point(distance, lateral)
    samples["z_m"], slope = oval_height(distance, lateral)
    samples["pitch_rad"] = -np.arctan(slope)
    samples["roll_rad"] = -np.arctan(BANK * np.cos(samples["pitch_rad"]))
    samples["velocity_x_m_s"] = speed
    samples["acceleration_x_m_s2"] = np.diff(speed, axis=0, prepend=0.0) * 10.0
    in_bend = (distance + STRAIGHT_M / 2) % (LAP_M / 2) > STRAIGHT_M
    samples["yaw_rate_rad_s"] = np.where(in_bend, speed / RADIUS_M, 0.0)
    samples["acceleration_y_m_s2"] = samples["yaw_rate_rad_s"] * speed
    samples["steering"] = np.where(in_bend, 0.25, 0.0) + rng.normal(0.0, 0.01, speed.shape)
    samples["throttle"] = np.where(driving, np.where(in_bend, 0.7, 1.0), 0.0)
    samples["brake"] = np.where(driving, 0.0, 1.0)
    samples["gear"] = 1 + (speed // 12).astype(int)
    samples["distance_m"] = distance
    samples["lateral_m"] = lateral
    samples["lap"] = np.maximum(distance // LAP_M, 0)
    samples["place"] = 1 + np.argsort(np.argsort(-distance, axis=1), axis=1)
    samples["slipstream"] = np.where(np.arange(cars) > 0, 0.4, 0.0)
    samples["penalty_s"][len(time_s) // 3 :, 1:2] = 3.0
    samples["off_course"][-1:, -1] = True
    samples["car_contact"][len(time_s) // 3, :2] = True
    samples["driving"] = driving

    incidents = (
        Incident(
            duration_s / 3,
            "contact",
            tuple(range(min(2, cars))),
            "Car 1 runs into car 0 from behind.",
            fault=1,
            closing_m_s=4.25,
            penalty_s=3.0,
        ),
        Incident(duration_s / 2, "ending", (cars - 1,), f"Car {cars - 1} is stuck."),
    )
    return RaceLog(
        circuit="oval",
        car="gt",
        scenario="made up",
        seed=seed,
        match="0123456789abcdef",
        race=3,
        version="0.1.0",
        names=tuple(f"entrant {'ab'[i % 2]}" for i in range(cars)),
        teams=tuple(i % 2 for i in range(cars)),
        car_length_m=4.6,
        car_width_m=1.95,
        outline=oval_outline(),
        sections=(
            NamedStretch("first bend", "corner", STRAIGHT_M / 2, LAP_M / 2 - STRAIGHT_M / 2),
            NamedStretch("back straight", "straight", LAP_M / 2 - STRAIGHT_M / 2, LAP_M / 2 + STRAIGHT_M / 2),
        ),
        time_s=time_s,
        samples=samples,
        incidents=incidents,
    )


def oval_outline() -> Outline:
    """Edges 6 m and walls 10 m from the oval's centre line, with a corner every 5 m.

    A kerb of 1 m on the left in the first half of the lap; gravel on the right, grass on the left; a penalty
    zone between 100 and 200 m, and a pit lane on the right in the first 100 m.
    """
    distance_m = np.arange(0.0, LAP_M, 5.0)

    def line(lateral_m: NDArray[np.float64] | float) -> NDArray[np.float64]:
        x, y, _ = oval_point(distance_m, lateral_m)
        return np.stack([x, y, oval_height(distance_m, lateral_m)[0]], axis=1)

    return Outline(
        left=line(6.0),
        centre=line(0.0),
        right=line(-6.0),
        kerb_left=line(np.where(distance_m < LAP_M / 2, 7.0, 6.0)),
        kerb_right=line(-6.0),
        wall_left=line(10.0),
        wall_right=line(-10.0),
        runoff_left=np.full(len(distance_m), SURFACES.index("grass")),
        runoff_right=np.full(len(distance_m), SURFACES.index("gravel")),
        zone=(distance_m >= 100.0) & (distance_m < 200.0),
        lane=np.where(distance_m < 100.0, -1, 0),
    )
