"""What cars with cameras saw of a recorded race, taken again from its log."""

from __future__ import annotations

import io
import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import KDTree

from nathlon.arena.race_log import RaceLog
from nathlon.reports._motion import POSE, poses
from nathlon.sim.camera.picture import Photographer
from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.car import load_car
from nathlon.sim.clock import DYNAMICS_HZ
from nathlon.sim.errors import InputError
from nathlon.sim.observation import PICTURE, ObservationSpec
from nathlon.sim.state import CAR_STATE
from nathlon.sim.track import X, Y, Z, load_track
from nathlon.sim.work_stealing import ThreadPool


def camera_of(log: RaceLog, car: int) -> CameraSpec | None:
    """By which a car's driver saw; None for one who was told numbers, and if circuit or car are not here."""
    camera = log.cameras[car] if log.cameras else None
    try:
        load_track(log.circuit)
        load_car(log.car)
    except InputError:
        return None
    return camera


def seen_pictures(log: RaceLog, car: int, time_s: NDArray[np.float64]) -> NDArray[np.uint8]:
    """What the camera of a car showed at these times, (n, height, width, 3), red, green and blue.

    Between two samples cars are where the log's other pictures have them. `camera_of` has to have one.
    """
    camera = camera_of(log, car)
    assert camera is not None, "its driver sees by a camera"
    track, n, cars = load_track(log.circuit), len(time_s), len(log.names)
    x, y, z, yaw, pitch, roll = (poses(log, time_s)[name] for name in POSE)
    ticks = np.searchsorted(log.time_s, time_s, side="right").clip(1) - 1
    samples, model = log.samples[ticks], load_car(log.car)
    state = np.zeros((n, cars), CAR_STATE)
    state["x"], state["y"], state["z"], state["yaw"] = x, y, z, yaw
    state["cos_yaw"], state["sin_yaw"] = np.cos(yaw), np.sin(yaw)
    state["slope_x"], state["slope_y"] = -np.tan(pitch), np.tan(roll) / np.cos(pitch)
    state["brake"], state["driving"] = samples["brake"], samples["driving"]
    state["steering"] = samples["steering"] * model.steering.full_lock_rad
    # The circuit's row under each car; height tells a bridge from the road below it.
    nodes = KDTree(track.table[:, [X, Y, Z]] * [1.0, 1.0, 4.0])
    state["row"] = nodes.query(np.stack([x, y, 4.0 * z], axis=-1))[1]
    # One that has stopped still looks.
    state["driving"][:, car] = True
    photographer = Photographer(ObservationSpec(camera=camera), track, model, cars)
    seen = photographer.observe(
        state, np.rint(time_s * DYNAMICS_HZ).astype(np.int64), np.arange(n), np.full(n, car), ThreadPool(1)
    )
    pictures: NDArray[np.uint8] = seen[PICTURE]
    return np.repeat(pictures, 3, axis=3) if camera.channels == 1 else pictures


def png(picture: NDArray[np.uint8], size: tuple[int, int]) -> bytes:
    """A picture (height, width, 3) as a PNG of so many pixels across and down, each pixel of it a block."""
    file = io.BytesIO()
    Image.fromarray(picture).resize(size, Image.Resampling.NEAREST).save(file, "PNG")
    return file.getvalue()


def proportion(camera: CameraSpec) -> float:
    """How much wider than high a picture is to be shown; its pixels need not be square."""
    across, down = (
        math.tan(math.radians(degrees) / 2.0)
        for degrees in (camera.field_of_view, camera.vertical_field_of_view)
    )
    return across / down
