"""How a replay is laid out in Rerun's viewer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from nathlon.arena.race_log import Outline, RaceLog
from nathlon.reports.cars import labels
from nathlon.reports.seen_pictures import camera_of

TIMELINE = "race_time"
SEEN = "seen"
"""What the followed car's camera shows."""
TRAIL_S = 4.0
MARK_S = 6.0
SERIES_S = 20.0
SKY = (150, 185, 215)


def blueprint(log: RaceLog, followed: int) -> rrb.Blueprint:
    """The race from behind one car, the map, the stewards' list and how that car was driven."""
    name = labels(log)[followed]
    marks = [f"world/incidents/{incident.kind}" for incident in log.incidents]
    names, dots = (
        [f"- world/cars/{car}/{part}" for car in range(len(log.names))] for part in ("name", "dot")
    )
    chase = chase_view(log, followed, "", f"Behind {name}")
    above = _space(
        f"Around {name}",
        rrb.EyeControls3D(tracking_entity=f"world/cars/{followed}/above"),
        dots,
        marks,
    )
    # There the names of marks would stand in a heap.
    nameless = rr.Points3D.from_fields(show_labels=False)
    whole = _space("Whole circuit", _above(log.outline), names, marks, nameless)
    circuit = map_view(log, "", f"Map of {log.circuit}")
    pedals = [f"$origin/{share}/{followed}" for share in ("throttle", "brake", "slipstream")]
    whole_race = absolute(float(log.time_s[-1]) if len(log.time_s) else 0.0)
    series = rrb.Vertical(
        series_view(
            "Speed (km/h), all cars; incidents",
            "series",
            ["$origin/speed/**", "$origin/incidents/**"],
            recent(),
        ),
        series_view(
            f"Throttle, brake and slipstream of {name}",
            "series",
            pedals,
            recent(),
            (-0.02, 1.02),
            legend=True,
        ),
        series_view(
            f"Steering of {name} (left +)", "series", [f"$origin/steering/{followed}"], recent(), (-1.0, 1.0)
        ),
        series_view(
            "Places (the first on top) and incidents, whole race",
            "series",
            ["$origin/place/**", "$origin/standings/**"],
            whole_race,
            (-len(log.names) - 0.5, -0.5),
        ),
        series_view("Gap to the first (s), whole race", "series", ["$origin/gap/**"], whole_race),
    )
    lists = rrb.Tabs(
        rrb.TextLogView(
            origin="incidents",
            name="Stewards",
            columns=rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["body"]),
        ),
        rrb.TextDocumentView(origin="race", name="Race"),
    )
    race = rrb.Tabs(chase, above, whole, active_tab=0)
    sight = rrb.Spatial2DView(origin=SEEN, name=f"What {name} sees")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                race
                if camera_of(log, followed) is None
                else rrb.Horizontal(race, sight, column_shares=[5, 2]),
                rrb.Horizontal(circuit, lists, column_shares=[4, 7]),
                row_shares=[3, 2],
            ),
            series,
            column_shares=[5, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


def chase_view(log: RaceLog, followed: int, branch: str, name: str) -> rrb.Spatial3DView:
    """A race from behind one car; `branch` is what its entities lie below, empty or ending in /."""
    cars = f"{branch}world/cars"
    dots = [f"- {cars}/{car}/dot" for car in range(len(log.names))]
    return _space(
        name,
        rrb.EyeControls3D(tracking_entity=f"{cars}/{followed}/chase"),
        [f"- {cars}/{followed}/name", f"- {branch}world/incidents/**", *dots],
        origin=f"{branch}world",
    )


def map_view(log: RaceLog, branch: str, name: str) -> rrb.Spatial2DView:
    """A race from above, with trails; `branch` as for `chase_view`."""
    shown_s = {f"{branch}map/trails/{car}": TRAIL_S for car in range(len(log.names))}
    shown_s |= {f"{branch}map/incidents/{incident.kind}": MARK_S for incident in log.incidents}
    return rrb.Spatial2DView(
        origin=f"{branch}map",
        name=name,
        background=[28, 30, 34],
        visual_bounds=_around(log.outline),
        overrides={entity: _last(seconds) for entity, seconds in shown_s.items()},
    )


def recent() -> rr.TimeRange:
    """The last seconds before the time cursor."""
    return rr.TimeRange(
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-SERIES_S),
        end=rr.TimeRangeBoundary.cursor_relative(),
    )


def absolute(end_s: float) -> rr.TimeRange:
    """A race from its start to its end."""
    return rr.TimeRange(
        start=rr.TimeRangeBoundary.absolute(seconds=0.0), end=rr.TimeRangeBoundary.absolute(seconds=end_s)
    )


def _space(
    name: str,
    eye: rrb.EyeControls3D,
    without: list[str],
    marks: Sequence[str] = (),
    *look: rrb.VisualizableArchetype,
    origin: str = "world",
) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin=origin,
        name=name,
        contents=["$origin/**", *without],
        eye_controls=eye,
        background=SKY,
        line_grid=False,
        overrides={mark: [_last(MARK_S), *look] for mark in marks},
    )


def _above(outline: Outline) -> rrb.EyeControls3D:
    """High in the south of the circuit, and looking at its middle."""
    low, high = outline.centre.min(axis=0), outline.centre.max(axis=0)
    middle, extent = (low + high) / 2, float(np.linalg.norm(high - low))
    return rrb.EyeControls3D(
        position=middle + extent * np.array([0.0, -0.55, 0.6]), look_target=middle, eye_up=[0.0, 0.0, 1.0]
    )


def series_view(
    name: str,
    origin: str,
    contents: list[str],
    shown: rr.TimeRange,
    span: tuple[float, float] | None = None,
    legend: bool = False,
) -> rrb.TimeSeriesView:
    """A chart of scalars below an entity, over a time that is shown."""
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        contents=contents,
        axis_x=rrb.TimeAxis(view_range=shown),
        axis_y=None if span is None else rrb.ScalarAxis(range=span),
        plot_legend=rrb.PlotLegend(visible=legend),
    )


def _around(outline: Outline) -> rrb.VisualBounds2D:
    """The whole circuit on the map, whose y points down the screen, with room for labels."""
    points = np.concatenate([outline.left, outline.right])[:, :2] * np.array([1.0, -1.0])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.08 * float((high - low).max())
    x_range, y_range = np.stack([low - margin, high + margin], axis=1).tolist()
    return rrb.VisualBounds2D(x_range=x_range, y_range=y_range)


def _last(seconds: float) -> rrb.VisibleTimeRanges:
    """What happened in the seconds before the time cursor."""
    return rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
