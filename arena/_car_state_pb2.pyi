from collections.abc import Iterable as _Iterable
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar

from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from google.protobuf.internal import containers as _containers

DESCRIPTOR: _descriptor.FileDescriptor

class CarState(_message.Message):
    __slots__ = (
        "acceleration_x_m_s2",
        "acceleration_y_m_s2",
        "brake",
        "car_contact",
        "distance_m",
        "driving",
        "gear",
        "lap",
        "lateral_m",
        "off_course",
        "place",
        "slipstream",
        "steering",
        "throttle",
        "velocity_x_m_s",
        "velocity_y_m_s",
        "wall_contact",
        "x_m",
        "y_m",
        "yaw_rad",
        "yaw_rate_rad_s",
    )
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    YAW_RAD_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_X_M_S_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_Y_M_S_FIELD_NUMBER: _ClassVar[int]
    YAW_RATE_RAD_S_FIELD_NUMBER: _ClassVar[int]
    ACCELERATION_X_M_S2_FIELD_NUMBER: _ClassVar[int]
    ACCELERATION_Y_M_S2_FIELD_NUMBER: _ClassVar[int]
    STEERING_FIELD_NUMBER: _ClassVar[int]
    THROTTLE_FIELD_NUMBER: _ClassVar[int]
    BRAKE_FIELD_NUMBER: _ClassVar[int]
    GEAR_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_M_FIELD_NUMBER: _ClassVar[int]
    LATERAL_M_FIELD_NUMBER: _ClassVar[int]
    LAP_FIELD_NUMBER: _ClassVar[int]
    PLACE_FIELD_NUMBER: _ClassVar[int]
    OFF_COURSE_FIELD_NUMBER: _ClassVar[int]
    WALL_CONTACT_FIELD_NUMBER: _ClassVar[int]
    CAR_CONTACT_FIELD_NUMBER: _ClassVar[int]
    SLIPSTREAM_FIELD_NUMBER: _ClassVar[int]
    DRIVING_FIELD_NUMBER: _ClassVar[int]
    x_m: float
    y_m: float
    yaw_rad: float
    velocity_x_m_s: float
    velocity_y_m_s: float
    yaw_rate_rad_s: float
    acceleration_x_m_s2: float
    acceleration_y_m_s2: float
    steering: float
    throttle: float
    brake: float
    gear: int
    distance_m: float
    lateral_m: float
    lap: int
    place: int
    off_course: bool
    wall_contact: bool
    car_contact: bool
    slipstream: float
    driving: bool
    def __init__(
        self,
        x_m: float | None = ...,
        y_m: float | None = ...,
        yaw_rad: float | None = ...,
        velocity_x_m_s: float | None = ...,
        velocity_y_m_s: float | None = ...,
        yaw_rate_rad_s: float | None = ...,
        acceleration_x_m_s2: float | None = ...,
        acceleration_y_m_s2: float | None = ...,
        steering: float | None = ...,
        throttle: float | None = ...,
        brake: float | None = ...,
        gear: int | None = ...,
        distance_m: float | None = ...,
        lateral_m: float | None = ...,
        lap: int | None = ...,
        place: int | None = ...,
        off_course: bool | None = ...,
        wall_contact: bool | None = ...,
        car_contact: bool | None = ...,
        slipstream: float | None = ...,
        driving: bool | None = ...,
    ) -> None: ...

class CarStates(_message.Message):
    __slots__ = ("cars", "time_s")
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    CARS_FIELD_NUMBER: _ClassVar[int]
    time_s: float
    cars: _containers.RepeatedCompositeFieldContainer[CarState]
    def __init__(
        self, time_s: float | None = ..., cars: _Iterable[CarState | _Mapping] | None = ...
    ) -> None: ...

class Incident(_message.Message):
    __slots__ = ("cars", "kind", "text", "time_s")
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    CARS_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    time_s: float
    kind: str
    cars: _containers.RepeatedScalarFieldContainer[int]
    text: str
    def __init__(
        self,
        time_s: float | None = ...,
        kind: str | None = ...,
        cars: _Iterable[int] | None = ...,
        text: str | None = ...,
    ) -> None: ...

class Polyline(_message.Message):
    __slots__ = ("x_m", "y_m")
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    x_m: _containers.RepeatedScalarFieldContainer[float]
    y_m: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, x_m: _Iterable[float] | None = ..., y_m: _Iterable[float] | None = ...) -> None: ...

class Race(_message.Message):
    __slots__ = (
        "car",
        "car_length_m",
        "car_width_m",
        "centre",
        "circuit",
        "left",
        "match",
        "names",
        "race",
        "right",
        "scenario",
        "seed",
        "teams",
        "version",
        "wall_left",
        "wall_right",
    )
    CIRCUIT_FIELD_NUMBER: _ClassVar[int]
    CAR_FIELD_NUMBER: _ClassVar[int]
    SCENARIO_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    MATCH_FIELD_NUMBER: _ClassVar[int]
    RACE_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    NAMES_FIELD_NUMBER: _ClassVar[int]
    TEAMS_FIELD_NUMBER: _ClassVar[int]
    CAR_LENGTH_M_FIELD_NUMBER: _ClassVar[int]
    CAR_WIDTH_M_FIELD_NUMBER: _ClassVar[int]
    LEFT_FIELD_NUMBER: _ClassVar[int]
    CENTRE_FIELD_NUMBER: _ClassVar[int]
    RIGHT_FIELD_NUMBER: _ClassVar[int]
    WALL_LEFT_FIELD_NUMBER: _ClassVar[int]
    WALL_RIGHT_FIELD_NUMBER: _ClassVar[int]
    circuit: str
    car: str
    scenario: str
    seed: int
    match: str
    race: int
    version: str
    names: _containers.RepeatedScalarFieldContainer[str]
    teams: _containers.RepeatedScalarFieldContainer[int]
    car_length_m: float
    car_width_m: float
    left: Polyline
    centre: Polyline
    right: Polyline
    wall_left: Polyline
    wall_right: Polyline
    def __init__(
        self,
        circuit: str | None = ...,
        car: str | None = ...,
        scenario: str | None = ...,
        seed: int | None = ...,
        match: str | None = ...,
        race: int | None = ...,
        version: str | None = ...,
        names: _Iterable[str] | None = ...,
        teams: _Iterable[int] | None = ...,
        car_length_m: float | None = ...,
        car_width_m: float | None = ...,
        left: Polyline | _Mapping | None = ...,
        centre: Polyline | _Mapping | None = ...,
        right: Polyline | _Mapping | None = ...,
        wall_left: Polyline | _Mapping | None = ...,
        wall_right: Polyline | _Mapping | None = ...,
    ) -> None: ...
