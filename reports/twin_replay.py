"""Two races from one start as one Rerun recording: side by side on one timeline."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from nathlon.reports._blueprint import TIMELINE, absolute, chase_view, map_view, recent, series_view
from nathlon.reports._motion import gaps
from nathlon.reports._rerun_file import rerun_file
from nathlon.reports.replay import log_race, race_name, race_sheet
from nathlon.reports.seen_data import PARTS, course_lines, opponents, own_numbers
from nathlon.results.twin import Side, Twins
from nathlon.sim.observation import PRESENT, X, Y

COLOURS = {"original": (125, 184, 238), "twin": (245, 180, 80)}
SEEN_M = 0.15
"""Height above the road at which what is seen is drawn."""
SHOWN = ("velocity", "steering", "throttle", "brake")
"""Fields that the layout shows; the others are there too."""


class Branch:
    """A part of a recording: what is logged there has its name before the entity's."""

    def __init__(self, stream: rr.RecordingStream, name: str) -> None:
        self._stream, self._name = stream, name

    def log(self, entity_path: str, entity: Any, *extra: Any, static: bool = False) -> None:
        """As `rerun.RecordingStream.log`."""
        self._stream.log(f"{self._name}/{entity_path}", entity, *extra, static=static)

    def send_columns(self, entity_path: str, indexes: Iterable[Any], columns: Iterable[Any]) -> None:
        """As `rerun.RecordingStream.send_columns`."""
        self._stream.send_columns(f"{self._name}/{entity_path}", indexes, columns)


def write_twin_replay(twins: Twins, path: Path) -> None:
    """Write both races as .rrd, each below its name, with the camera behind the car that is looked at.

    What its drivers saw lies below `seen`, a scalar for every number, and in the scene as lines and points.
    A file of that name is replaced whole.
    """
    logs = twins.original.log, twins.twin.log
    identity = "-".join(f"{log.match[:16]}-{log.race}" for log in logs)
    sheet = "\n\n".join(f"## {name}\n\n{race_sheet(log)}" for name, log in zip(COLOURS, logs, strict=True))
    with rerun_file(path, identity, f"{race_name(logs[0])}, with its twin", _blueprint(twins)) as stream:
        for name, side in (("original", twins.original), ("twin", twins.twin)):
            log_race(Branch(stream, name), side.log, twins.car)
            _log_car(stream, name, side, twins.car)
            _log_seen(stream, name, side, twins.car)
        stream.log("races", rr.TextDocument(sheet, media_type=rr.MediaType.MARKDOWN), static=True)


def _log_car(stream: rr.RecordingStream, name: str, side: Side, car: int) -> None:
    """Place and gap of the car, so that those of both races stand in one chart."""
    log, driving = side.log, side.log.samples["driving"][:, car]
    gap_s = gaps(log)[:, car]
    for what, values, known in (
        ("place", -log.samples["place"][:, car].astype(float), np.ones(len(driving), bool)),
        ("gap", -gap_s, driving & np.isfinite(gap_s)),
    ):
        _log_series(stream, f"car/{what}/{name}", name, log.time_s[known], values[known], name)


def _log_seen(stream: rr.RecordingStream, name: str, side: Side, car: int) -> None:
    scene = f"{name}/world/cars/{car}/seen"
    raised = np.array([0.0, 0.0, SEEN_M])
    stream.log(f"{scene}/course", rr.LineStrips3D.from_fields(radii=0.08, colors=COLOURS[name]), static=True)
    stream.log(f"{scene}/cars", rr.Points3D.from_fields(radii=0.5, colors=COLOURS[name]), static=True)
    for seen in side.seen:
        index = [rr.TimeColumn(TIMELINE, duration=seen.time_s)]
        edges = course_lines(seen)[:, :, [0, 2]].swapaxes(1, 2) + raised
        n, lines, points, _ = edges.shape
        if points > 1:
            strips = rr.LineStrips3D.columns(strips=list(edges.reshape(n * lines, points, 3)))
            stream.send_columns(f"{scene}/course", index, strips.partition(np.full(n, lines)))
        others = np.concatenate([opponents(seen, where) for where in ("ahead", "behind")], axis=1)
        present = others[:, :, PRESENT] > 0.5
        places = np.concatenate([others[:, :, [X, Y]], np.full((*present.shape, 1), SEEN_M)], axis=2)
        dots = rr.Points3D.columns(positions=places[present])
        stream.send_columns(f"{scene}/cars", index, dots.partition(present.sum(axis=1)))
        for field, numbers in own_numbers(seen).items():
            parts = PARTS.get(field, ("",))
            for part, values in zip(parts, numbers.T, strict=True):
                entity = "/".join(filter(None, ["seen", field, part.replace(" ", "_"), name]))
                _log_series(stream, entity, name, seen.time_s, values, f"{name} {part}".strip())


def _log_series(
    stream: rr.RecordingStream, entity: str, side: str, time_s: Any, values: Any, label: str
) -> None:
    look = rr.SeriesLines(colors=COLOURS[side], names=label, widths=3.0 if side == "original" else 1.5)
    stream.log(entity, look, static=True)
    index = [rr.TimeColumn(TIMELINE, duration=time_s)]
    stream.send_columns(entity, index, rr.Scalars.columns(scalars=values))


def _blueprint(twins: Twins) -> rrb.Blueprint:
    """Both races beside each other, below them their maps, and the car in both over time."""
    sides = [("original", twins.original.log), ("twin", twins.twin.log)]
    end_s = max(float(log.time_s[-1]) for _, log in sides)
    seen = (
        [series_view(f"Sees: {field}", "seen", [f"$origin/{field}/**"], recent()) for field in SHOWN]
        if twins.original.seen
        else []
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Horizontal(
                    *(
                        chase_view(
                            log, twins.car, f"{name}/", f"{name}: behind {twins.car} {log.names[twins.car]}"
                        )
                        for name, log in sides
                    )
                ),
                rrb.Horizontal(*(map_view(log, f"{name}/", f"{name}: map") for name, log in sides)),
                row_shares=[3, 2],
            ),
            rrb.Vertical(
                series_view(
                    f"Place of {twins.car}", "car", ["$origin/place/**"], absolute(end_s), legend=True
                ),
                series_view(
                    f"Gap of {twins.car} to the first (s)", "car", ["$origin/gap/**"], absolute(end_s)
                ),
                *seen,
            ),
            column_shares=[5, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )
