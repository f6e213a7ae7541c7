"""Replays: a race as a Rerun recording with its own layout, made from the race's log."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import rerun as rr

from nathlon.arena.race_log import NOTICES, Incident, RaceLog, orientation
from nathlon.policies.hosting.programs import complaint
from nathlon.reports._blueprint import SEEN, TIMELINE, blueprint
from nathlon.reports._circuit import Logging, log_circuit, log_map, north_up
from nathlon.reports._motion import POSE, gaps, poses
from nathlon.reports._rerun_file import rerun_file
from nathlon.reports.car_model import car_model
from nathlon.reports.cars import car_colours, labels, winner
from nathlon.reports.seen_pictures import camera_of, png, proportion, seen_pictures
from nathlon.sim.errors import InputError
from nathlon.sim.process import command_of

FRAMES_PER_TICK = 3
"""Pictures between two samples of the log: cars at 10 Hz would jump by several metres."""

CAMERAS = {"chase": ((-10.0, 0.0, 3.4), 9.0), "above": ((-42.0, 0.0, 26.0), 30.0)}
"""Those that go with the followed car: place in its frame, metres, and degrees that they look down."""

MARK_COLOURS = {
    "contact": (235, 60, 70),
    "wall": (225, 70, 200),
    "off_course": (205, 165, 85),
    "penalty": (245, 180, 50),
    "served": (100, 200, 110),
    "ending": (165, 170, 175),
}
"""Of incidents by kind."""
MARK_M = 2.5
"""Height above the road."""
DRAUGHT_COLOUR = (150, 215, 255)
DRAUGHT_M = 12.0
"""Length of the streaks ahead of a car in full slipstream."""
DRAUGHT_SEEN = 0.05
"""Share of the full slipstream from which it is drawn."""


def write_replay(log: RaceLog, path: Path, follow: int | None = None) -> None:
    """Write a race as .rrd, with the camera behind car `follow` (the winner if None).

    A file of that name is replaced whole.
    """
    followed = winner(log) if follow is None else follow
    with rerun_file(path, f"{log.match}-{log.race}", race_name(log), blueprint(log, followed)) as stream:
        log_race(stream, log, followed)
        stream.log("race", rr.TextDocument(race_sheet(log), media_type=rr.MediaType.MARKDOWN), static=True)


def log_race(stream: Logging, log: RaceLog, followed: int) -> None:
    """Log the circuit, the cars with their cameras, how they were driven, and what the stewards noted."""
    log_circuit(stream, log.outline)
    log_map(stream, log.outline)
    _log_cars(stream, log, followed)
    _log_series(stream, log, followed)
    _log_incidents(stream, log)
    _log_sight(stream, log, followed)


def open_viewer(replay: Path) -> None:
    """Show a replay in Rerun's viewer and wait until its window is closed.

    Raises InputError if the viewer cannot run here, for want of a display for instance.
    """
    viewer = command_of("rerun", "--bind", "127.0.0.1", "--port", "auto", replay)
    if reason := complaint(viewer, "it gave no reason"):
        raise InputError(f"{replay} cannot be shown, as Rerun's viewer does not run here: {reason}")


def race_name(log: RaceLog) -> str:
    """What tells this race from others, in a list or a title."""
    return f"{log.circuit}, race {log.race} of match {log.match[:10]}"


def race_sheet(log: RaceLog) -> str:
    """What was raced and how it stood at the end, as Markdown."""
    facts = {
        "Circuit": log.circuit,
        "Car": log.car,
        "Scenario": log.scenario,
        "Match": f"{log.match}, race {log.race}",
        "Seed": log.seed,
        "nathlon": log.version,
    }
    lines = ["| | |", "|---|---|", *(f"| {fact} | {_plain(value)} |" for fact, value in facts.items())]
    if len(log.time_s):
        last = log.samples[-1]
        lines += ["", "| Place | Car | Team | Laps | Distance |", "|--:|---|--:|--:|--:|"]
        for car in np.argsort(last["place"], kind="stable").tolist():
            place, lap, distance_m = last["place"][car], last["lap"][car], last["distance_m"][car]
            lines.append(
                f"| {place} | {_plain(labels(log)[car])} | {log.teams[car]} | {lap} | {distance_m:.0f} m |"
            )
    return "\n".join(lines)


def _plain(value: object) -> str:
    """A value in a Markdown table as it is: https://spec.commonmark.org/0.31.2/#backslash-escapes."""
    return re.sub(r"([!-/:-@\[-`{-~])", r"\\\1", str(value))


def _log_cars(stream: Logging, log: RaceLog, followed: int) -> None:
    ticks = np.arange(len(log.time_s))
    if not len(ticks):
        return
    frames = np.arange((len(ticks) - 1) * FRAMES_PER_TICK + 1) / FRAMES_PER_TICK
    time_s = np.interp(frames, ticks, log.time_s)
    index = [rr.TimeColumn(TIMELINE, duration=time_s)]
    at = poses(log, time_s)
    for car, (colour, label) in enumerate(zip(car_colours(log), labels(log), strict=True)):
        x, y, z, yaw, pitch, roll = (at[name][:, car] for name in POSE)
        pose = rr.Transform3D.columns(
            translation=np.stack([x, y, z], axis=1), quaternion=orientation(yaw, pitch, roll)
        )
        stream.send_columns(f"world/cars/{car}", index, pose)
        _log_body(stream, log, car, colour, label)
        _log_draught(stream, log, car)

        point = rr.Points2D.columns(positions=north_up(np.stack([x, y], axis=1)))
        look = rr.Points2D.from_fields(
            radii=-5.0, colors=colour, labels=label, show_labels=car == followed, draw_order=50.0
        )
        stream.send_columns(f"map/cars/{car}", index, point)
        stream.log(f"map/cars/{car}", look, static=True)
        _log_trail(stream, log, car, colour)
    _log_cameras(stream, followed)


def _log_body(stream: Logging, log: RaceLog, car: int, colour: tuple[int, int, int], label: str) -> None:
    vertices, triangles, colours = car_model(log.car_length_m, log.car_width_m, colour)
    body = rr.Mesh3D(vertex_positions=vertices, triangle_indices=triangles, vertex_colors=colours)
    stream.log(f"world/cars/{car}/body", body, static=True)
    name = rr.Points3D([[0, 0, 1.9]], radii=0.0, colors=colour, labels=label, show_labels=True)
    stream.log(f"world/cars/{car}/name", name, static=True)
    # For where the whole circuit is seen, and cars are too small.
    dot = rr.Points3D([[0, 0, 1.9]], radii=-5.0, colors=colour)
    stream.log(f"world/cars/{car}/dot", dot, static=True)


def _log_draught(stream: Logging, log: RaceLog, car: int) -> None:
    """Streaks of air ahead of the car, the longer the deeper it sits in the wakes of others."""
    side, nose_m = 0.4 * log.car_width_m, log.car_length_m / 2
    roots = np.array([[nose_m, y, z] for y in (-side, 0.0, side) for z in (0.5, 1.1)])
    share = log.samples["slipstream"][:, car].astype(np.float64)
    drawn = share > DRAUGHT_SEEN
    reach = DRAUGHT_M * share[drawn, None, None] * np.array([1.0, 0.0, 0.0])
    strips = np.stack([np.broadcast_to(roots, (len(reach), *roots.shape)), roots + reach], axis=2)
    streaks = rr.LineStrips3D.columns(strips=strips.reshape(-1, 2, 3))
    look = rr.LineStrips3D.from_fields(radii=0.025, colors=DRAUGHT_COLOUR)
    stream.log(f"world/cars/{car}/draught", look, static=True)
    index = [rr.TimeColumn(TIMELINE, duration=log.time_s)]
    stream.send_columns(f"world/cars/{car}/draught", index, streaks.partition(len(roots) * drawn))


def _log_trail(stream: Logging, log: RaceLog, car: int, colour: tuple[int, int, int]) -> None:
    """One stroke from each sample to the next; the map shows the last few."""
    path = north_up(np.stack([log.samples["x_m"][:, car], log.samples["y_m"][:, car]], axis=1))
    strokes = rr.LineStrips2D.columns(strips=np.stack([path[:-1], path[1:]], axis=1))
    index = [rr.TimeColumn(TIMELINE, duration=log.time_s[1:])]
    stream.send_columns(f"map/trails/{car}", index, strokes)
    stream.log(f"map/trails/{car}", rr.LineStrips2D.from_fields(radii=-1.5, colors=colour), static=True)


def _log_cameras(stream: Logging, followed: int) -> None:
    for name, (metres, down_degrees) in CAMERAS.items():
        stream.log(
            f"world/cars/{followed}/{name}",
            rr.Transform3D(
                translation=metres, rotation=rr.RotationAxisAngle(axis=[0, 1, 0], degrees=down_degrees)
            ),
            rr.Pinhole(
                fov_y=1.0,
                aspect_ratio=1.6,
                camera_xyz=rr.ViewCoordinates.FLU,
                # The camera's own frame would stand in the picture.
                image_plane_distance=1e-4,
                color=[0, 0, 0, 0],
            ),
            static=True,
        )


def _log_sight(stream: Logging, log: RaceLog, followed: int) -> None:
    """What the followed car's camera showed at each sample."""
    camera = camera_of(log, followed)
    if camera is None or not len(log.time_s):
        return
    shown = (240, round(240 / proportion(camera)))
    pictures = [png(picture, shown) for picture in seen_pictures(log, followed, log.time_s)]
    images = rr.EncodedImage.columns(blob=pictures, media_type=["image/png"] * len(pictures))
    stream.send_columns(SEEN, [rr.TimeColumn(TIMELINE, duration=log.time_s)], images)


def _log_series(stream: Logging, log: RaceLog, followed: int) -> None:
    gap_s = gaps(log)
    for car, (colour, label) in enumerate(zip(car_colours(log), labels(log), strict=True)):
        sample = log.samples[:, car]
        speed = np.hypot(sample["velocity_x_m_s"], sample["velocity_y_m_s"])
        series = {
            "speed": (3.6 * speed, colour, label),
            "throttle": (sample["throttle"], (90, 200, 90), "throttle"),
            "brake": (sample["brake"], (225, 70, 60), "brake"),
            "steering": (sample["steering"], (200, 200, 120), "steering"),
            "slipstream": (sample["slipstream"], DRAUGHT_COLOUR, "slipstream"),
            "place": (-sample["place"].astype(float), colour, label),
            "gap": (-gap_s[:, car], colour, label),
        }
        for name, (values, line_colour, line_name) in series.items():
            entity = f"series/{name}/{car}"
            known = np.isfinite(values) & (sample["driving"] | (name == "place"))
            look = rr.SeriesLines(colors=line_colour, names=line_name, widths=2.5 if car == followed else 1.0)
            stream.log(entity, look, static=True)
            index = [rr.TimeColumn(TIMELINE, duration=log.time_s[known])]
            stream.send_columns(entity, index, rr.Scalars.columns(scalars=values[known]))


def _log_incidents(stream: Logging, log: RaceLog) -> None:
    """What the stewards noted: as text, and as marks in the scene, on the map and on speeds and places."""
    for kind in sorted({incident.kind for incident in log.incidents}):
        incidents, colour = [i for i in log.incidents if i.kind == kind], MARK_COLOURS[kind]
        time_s = np.array([incident.time_s for incident in incidents])
        index = [rr.TimeColumn(TIMELINE, duration=time_s)]
        level = rr.TextLogLevel.INFO if kind in NOTICES else rr.TextLogLevel.WARN
        texts = rr.TextLog.columns(
            text=[incident.text for incident in incidents],
            level=[level] * len(incidents),
            color=[colour] * len(incidents),
        )
        # The list has no room for more digits.
        tenths = [rr.TimeColumn(TIMELINE, duration=np.round(time_s, 1))]
        stream.send_columns(f"incidents/{kind}", tenths, texts)

        found = [_car_of(incident, log) for incident in incidents]
        places = np.array([[car["x_m"], car["y_m"], car["z_m"] + MARK_M] for car in found])
        flat = rr.Points2D.from_fields(
            radii=-5.0, colors=colour, labels=kind, show_labels=False, draw_order=40.0
        )
        stream.log(f"map/incidents/{kind}", flat, static=True)
        stream.send_columns(f"map/incidents/{kind}", index, rr.Points2D.columns(positions=north_up(places)))
        mark = rr.Points3D.from_fields(radii=-6.0, colors=colour, labels=kind)
        stream.log(f"world/incidents/{kind}", mark, static=True)
        stream.send_columns(f"world/incidents/{kind}", index, rr.Points3D.columns(positions=places))

        speeds = [3.6 * float(np.hypot(car["velocity_x_m_s"], car["velocity_y_m_s"])) for car in found]
        standings = [-float(car["place"]) for car in found]
        for name, values in (("incidents", speeds), ("standings", standings)):
            look = rr.SeriesPoints(colors=colour, names=kind, markers="diamond", marker_sizes=5.0)
            stream.log(f"series/{name}/{kind}", look, static=True)
            stream.send_columns(f"series/{name}/{kind}", index, rr.Scalars.columns(scalars=values))


def _car_of(incident: Incident, log: RaceLog) -> np.void:
    """The sample of the first car concerned at the time of an incident."""
    tick = min(int(np.searchsorted(log.time_s, incident.time_s)), len(log.time_s) - 1)
    car: np.void = log.samples[tick, incident.cars[0]]
    return car
