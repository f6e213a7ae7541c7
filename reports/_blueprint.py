"""How a replay is laid out in Rerun's viewer."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from arena.race_log import RaceLog

TIMELINE = "race_time"
TRAIL_S = 4.0
MARK_S = 6.0
SERIES_S = 20.0


def blueprint(log: RaceLog, followed: int) -> rrb.Blueprint:
    """The race from behind one car, the map, the stewards' list and how that car was driven."""
    name = f"{followed} {log.names[followed]}"
    chase = rrb.Spatial3DView(
        origin="world",
        name=f"Behind {name}",
        contents=["$origin/**", f"- world/cars/{followed}/name"],
        eye_controls=rrb.EyeControls3D(tracking_entity=f"world/cars/{followed}/chase"),
        background=[150, 185, 215],
        line_grid=False,
    )
    trails = {f"map/trails/{car}": _last(TRAIL_S) for car in range(len(log.names))}
    circuit = rrb.Spatial2DView(
        origin="map",
        name=f"Map of {log.circuit}",
        background=[28, 30, 34],
        overrides={**trails, "map/incidents": _last(MARK_S)},
    )
    series = rrb.Vertical(
        _series("Speed (km/h)", "$origin/**", "series/speed"),
        _series(
            "Throttle and brake",
            [f"series/throttle/{followed}", f"series/brake/{followed}"],
            "series",
            (0.0, 1.0),
        ),
        _series("Steering (left +)", [f"series/steering/{followed}"], "series", (-1.0, 1.0)),
        rrb.Tabs(
            _series("Places", "$origin/**", "series/place", (-len(log.names) - 0.5, -0.5)),
            _series("Gap to the leader (m)", "$origin/**", "series/gap"),
        ),
    )
    lists = rrb.Tabs(
        rrb.TextLogView(
            origin="incidents",
            name="Stewards",
            columns=rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["entitypath", "body"]),
        ),
        rrb.TextDocumentView(origin="race", name="Race"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(chase, rrb.Horizontal(circuit, lists, column_shares=[3, 2]), row_shares=[3, 2]),
            series,
            column_shares=[5, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


def _series(
    name: str, contents: str | list[str], origin: str, span: tuple[float, float] | None = None
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        contents=contents,
        time_ranges=_last(SERIES_S),
        axis_y=None if span is None else rrb.ScalarAxis(range=span),
    )


def _last(seconds: float) -> rrb.VisibleTimeRanges:
    """What happened in the seconds before the time cursor."""
    return rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
