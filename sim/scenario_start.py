"""How cars are placed when a scenario begins, as its file says it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from nathlon.sim.data_file import Section

MOST_CARS = 20
Metres = Annotated[float, Field(ge=-1e6, le=1e6)]
Speed = Annotated[float, Field(ge=-120, le=120)]
"""m/s; beyond it the driver knows no car."""
Angle = Annotated[float, Field(ge=-7, le=7)]


def _rising(span: tuple[float, float]) -> tuple[float, float]:
    if span[0] > span[1]:
        raise ValueError("expected the smaller number first")
    return span


Span = Annotated[tuple[Metres, Metres], AfterValidator(_rising)]
Speeds = Annotated[tuple[Speed, Speed], AfterValidator(_rising)]
Angles = Annotated[tuple[Angle, Angle], AfterValidator(_rising)]


class GridStart(Section):
    """A standing start from the circuit's grid, with a little disorder in the places."""

    kind: Literal["grid"]
    jitter_m: Annotated[float, Field(ge=0, le=100)] = 0.3


class StoppedCar(Section):
    """The first car of a column stands on the road; every quantity is drawn evenly from its span."""

    gap_m: Span  # to the next car, instead of that of the column
    lateral_m: Span
    heading_rad: Angles  # relative to the road, + is to the left


class RollingStart(Section):
    """A column of cars on the move; every quantity is drawn evenly from its span."""

    kind: Literal["rolling"]
    leader_m: Span  # first car, from the scenario's origin
    gap_m: Span  # from each car to the next, between centres
    lateral_m: Span
    speed_m_s: Speeds  # one for all cars
    closing_m_s: Speeds | None = None  # by which each car is faster than the one before it
    stopped: StoppedCar | None = None


class FormationStart(Section):
    """A rolling start: the grid on the move, two by two, towards the line."""

    kind: Literal["formation"]
    leader_m: Metres  # progress of the first car
    gap_m: Annotated[float, Field(gt=0, le=1e6)]  # from each car to the next, along the road
    speed_m_s: Annotated[float, Field(gt=0, le=120)]
    jitter_m: Annotated[float, Field(ge=0, le=100)] = 0.0  # along and across the road, drawn evenly


class AbreastStart(Section):
    """Cars side by side on the move, before the end of the origin; quantities are drawn evenly from spans."""

    kind: Literal["abreast"]
    before_end_m: Span  # from the first car to the end of the origin
    behind_m: Span  # from each car to the next
    apart_m: Annotated[float, Field(gt=0, le=100)]  # across the road; leftmost or rightmost is first, by lot
    speed_m_s: Speeds  # one for all cars


class AnywhereStart(Section):
    """Anywhere on the lap, at any speed from rest to what the road ahead allows, a column of cars."""

    kind: Literal["anywhere"]
    gap_m: Span
    beside_share: Annotated[float, Field(ge=0, le=1)]  # of starts with the first car beside the road
    spun_share: Annotated[float, Field(ge=0, le=1)] = 0.0  # at rest anywhere, facing anywhere


class FrozenCar(Section):
    """A car as it was at some moment of a race."""

    progress_m: Metres
    lateral_m: Metres
    heading_rad: Angle  # relative to the road, + is to the left
    speed_m_s: Speed  # along the heading
    side_speed_m_s: Speed = 0.0  # to its left
    yaw_rate_rad_s: Annotated[float, Field(ge=-20, le=20)] = 0.0


class FrozenStart(Section):
    """Cars as they were at some moment of a race, with a little disorder."""

    kind: Literal["frozen"]
    jitter_m: Annotated[float, Field(ge=0, le=10)] = 0.1  # along and across the road
    jitter_m_s: Annotated[float, Field(ge=0, le=10)] = 0.1  # along the heading
    car: Annotated[tuple[FrozenCar, ...], Field(min_length=1, max_length=MOST_CARS)]
