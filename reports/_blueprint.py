"""How a replay is laid out in Rerun's viewer."""

from __future__ import annotations

import numpy as np
import rerun.blueprint as rrb

from arena.race_log import Outline, RaceLog

TIMELINE = "race_time"
TRAIL_S = 4.0
MARK_S = 6.0
SERIES_S = 20.0


def blueprint(log: RaceLog, followed: int) -> rrb.Blueprint:
    """The race from behind one car, the map, the stewards' list and how that car was driven."""
    name = f"{followed} {log.names[followed]}"
    marks_s = {f"world/incidents/{incident.kind}": MARK_S for incident in log.incidents}
    chase = _space(
        f"Behind {name}",
        rrb.EyeControls3D(tracking_entity=f"world/cars/{followed}/chase"),
        [f"- world/cars/{followed}/name", "- world/incidents/**"],
        {},
    )
    above = _space(
        f"Around {name}", rrb.EyeControls3D(tracking_entity=f"world/cars/{followed}/above"), [], marks_s
    )
    whole = _space("Whole circuit", _above(log.outline), [], marks_s)
    shown_s = {f"map/trails/{car}": TRAIL_S for car in range(len(log.names))}
    shown_s |= {f"map/incidents/{incident.kind}": MARK_S for incident in log.incidents}
    circuit = rrb.Spatial2DView(
        origin="map",
        name=f"Map of {log.circuit}",
        background=[28, 30, 34],
        visual_bounds=_around(log.outline),
        overrides={entity: _last(seconds) for entity, seconds in shown_s.items()},
    )
    pedals = [f"$origin/{share}/{followed}" for share in ("throttle", "brake", "slipstream")]
    series = rrb.Vertical(
        _series("Speed (km/h), all cars; incidents", ["$origin/speed/**", "$origin/incidents/**"]),
        _series(f"Throttle, brake and slipstream of {name}", pedals, (-0.02, 1.02), legend=True),
        _series(f"Steering of {name} (left +)", [f"$origin/steering/{followed}"], (-1.0, 1.0)),
        rrb.Tabs(
            _series("Places", ["$origin/place/**"], (-len(log.names) - 0.5, -0.5)),
            _series("Gap to the leader (m)", ["$origin/gap/**"]),
        ),
    )
    lists = rrb.Tabs(
        rrb.TextLogView(
            origin="incidents",
            name="Stewards",
            columns=rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["body"]),
        ),
        rrb.TextDocumentView(origin="race", name="Race"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Tabs(chase, above, whole, active_tab=0),
                rrb.Horizontal(circuit, lists, column_shares=[1, 1]),
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


def _space(
    name: str, eye: rrb.EyeControls3D, without: list[str], shown_s: dict[str, float]
) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin="world",
        name=name,
        contents=["$origin/**", *without],
        eye_controls=eye,
        background=[150, 185, 215],
        line_grid=False,
        overrides={entity: _last(seconds) for entity, seconds in shown_s.items()},
    )


def _above(outline: Outline) -> rrb.EyeControls3D:
    """High in the south of the circuit, and looking at its middle."""
    low, high = outline.centre.min(axis=0), outline.centre.max(axis=0)
    middle, extent = (low + high) / 2, float(np.linalg.norm(high - low))
    return rrb.EyeControls3D(
        position=middle + extent * np.array([0.0, -0.55, 0.6]), look_target=middle, eye_up=[0.0, 0.0, 1.0]
    )


def _series(
    name: str, contents: list[str], span: tuple[float, float] | None = None, legend: bool = False
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin="series",
        name=name,
        contents=contents,
        time_ranges=_last(SERIES_S),
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
