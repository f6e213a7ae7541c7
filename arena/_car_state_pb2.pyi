from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class CarState(_message.Message):
    __slots__ = ("x_m", "y_m", "z_m", "yaw_rad", "pitch_rad", "roll_rad", "velocity_x_m_s", "velocity_y_m_s", "yaw_rate_rad_s", "acceleration_x_m_s2", "acceleration_y_m_s2", "steering", "throttle", "brake", "gear", "distance_m", "lateral_m", "lap", "place", "penalty_s", "off_course", "wall_contact", "car_contact", "slipstream", "driving")
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    Z_M_FIELD_NUMBER: _ClassVar[int]
    YAW_RAD_FIELD_NUMBER: _ClassVar[int]
    PITCH_RAD_FIELD_NUMBER: _ClassVar[int]
    ROLL_RAD_FIELD_NUMBER: _ClassVar[int]
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
    PENALTY_S_FIELD_NUMBER: _ClassVar[int]
    OFF_COURSE_FIELD_NUMBER: _ClassVar[int]
    WALL_CONTACT_FIELD_NUMBER: _ClassVar[int]
    CAR_CONTACT_FIELD_NUMBER: _ClassVar[int]
    SLIPSTREAM_FIELD_NUMBER: _ClassVar[int]
    DRIVING_FIELD_NUMBER: _ClassVar[int]
    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    pitch_rad: float
    roll_rad: float
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
    penalty_s: float
    off_course: bool
    wall_contact: bool
    car_contact: bool
    slipstream: float
    driving: bool
    def __init__(self, x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., z_m: _Optional[float] = ..., yaw_rad: _Optional[float] = ..., pitch_rad: _Optional[float] = ..., roll_rad: _Optional[float] = ..., velocity_x_m_s: _Optional[float] = ..., velocity_y_m_s: _Optional[float] = ..., yaw_rate_rad_s: _Optional[float] = ..., acceleration_x_m_s2: _Optional[float] = ..., acceleration_y_m_s2: _Optional[float] = ..., steering: _Optional[float] = ..., throttle: _Optional[float] = ..., brake: _Optional[float] = ..., gear: _Optional[int] = ..., distance_m: _Optional[float] = ..., lateral_m: _Optional[float] = ..., lap: _Optional[int] = ..., place: _Optional[int] = ..., penalty_s: _Optional[float] = ..., off_course: _Optional[bool] = ..., wall_contact: _Optional[bool] = ..., car_contact: _Optional[bool] = ..., slipstream: _Optional[float] = ..., driving: _Optional[bool] = ...) -> None: ...

class CarStates(_message.Message):
    __slots__ = ("time_s", "cars")
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    CARS_FIELD_NUMBER: _ClassVar[int]
    time_s: float
    cars: _containers.RepeatedCompositeFieldContainer[CarState]
    def __init__(self, time_s: _Optional[float] = ..., cars: _Optional[_Iterable[_Union[CarState, _Mapping]]] = ...) -> None: ...

class Incident(_message.Message):
    __slots__ = ("time_s", "kind", "cars", "text", "fault", "closing_m_s", "penalty_s")
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    CARS_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    FAULT_FIELD_NUMBER: _ClassVar[int]
    CLOSING_M_S_FIELD_NUMBER: _ClassVar[int]
    PENALTY_S_FIELD_NUMBER: _ClassVar[int]
    time_s: float
    kind: str
    cars: _containers.RepeatedScalarFieldContainer[int]
    text: str
    fault: int
    closing_m_s: float
    penalty_s: float
    def __init__(self, time_s: _Optional[float] = ..., kind: _Optional[str] = ..., cars: _Optional[_Iterable[int]] = ..., text: _Optional[str] = ..., fault: _Optional[int] = ..., closing_m_s: _Optional[float] = ..., penalty_s: _Optional[float] = ...) -> None: ...

class Stretch(_message.Message):
    __slots__ = ("name", "kind", "start_m", "end_m")
    NAME_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    START_M_FIELD_NUMBER: _ClassVar[int]
    END_M_FIELD_NUMBER: _ClassVar[int]
    name: str
    kind: str
    start_m: float
    end_m: float
    def __init__(self, name: _Optional[str] = ..., kind: _Optional[str] = ..., start_m: _Optional[float] = ..., end_m: _Optional[float] = ...) -> None: ...

class Polyline(_message.Message):
    __slots__ = ("x_m", "y_m", "z_m")
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    Z_M_FIELD_NUMBER: _ClassVar[int]
    x_m: _containers.RepeatedScalarFieldContainer[float]
    y_m: _containers.RepeatedScalarFieldContainer[float]
    z_m: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, x_m: _Optional[_Iterable[float]] = ..., y_m: _Optional[_Iterable[float]] = ..., z_m: _Optional[_Iterable[float]] = ...) -> None: ...

class Race(_message.Message):
    __slots__ = ("circuit", "car", "scenario", "seed", "match", "race", "version", "names", "teams", "car_length_m", "car_width_m", "left", "centre", "right", "kerb_left", "kerb_right", "wall_left", "wall_right", "runoff_left", "runoff_right", "zone", "sections", "lane")
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
    KERB_LEFT_FIELD_NUMBER: _ClassVar[int]
    KERB_RIGHT_FIELD_NUMBER: _ClassVar[int]
    WALL_LEFT_FIELD_NUMBER: _ClassVar[int]
    WALL_RIGHT_FIELD_NUMBER: _ClassVar[int]
    RUNOFF_LEFT_FIELD_NUMBER: _ClassVar[int]
    RUNOFF_RIGHT_FIELD_NUMBER: _ClassVar[int]
    ZONE_FIELD_NUMBER: _ClassVar[int]
    SECTIONS_FIELD_NUMBER: _ClassVar[int]
    LANE_FIELD_NUMBER: _ClassVar[int]
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
    kerb_left: Polyline
    kerb_right: Polyline
    wall_left: Polyline
    wall_right: Polyline
    runoff_left: _containers.RepeatedScalarFieldContainer[int]
    runoff_right: _containers.RepeatedScalarFieldContainer[int]
    zone: _containers.RepeatedScalarFieldContainer[bool]
    sections: _containers.RepeatedCompositeFieldContainer[Stretch]
    lane: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, circuit: _Optional[str] = ..., car: _Optional[str] = ..., scenario: _Optional[str] = ..., seed: _Optional[int] = ..., match: _Optional[str] = ..., race: _Optional[int] = ..., version: _Optional[str] = ..., names: _Optional[_Iterable[str]] = ..., teams: _Optional[_Iterable[int]] = ..., car_length_m: _Optional[float] = ..., car_width_m: _Optional[float] = ..., left: _Optional[_Union[Polyline, _Mapping]] = ..., centre: _Optional[_Union[Polyline, _Mapping]] = ..., right: _Optional[_Union[Polyline, _Mapping]] = ..., kerb_left: _Optional[_Union[Polyline, _Mapping]] = ..., kerb_right: _Optional[_Union[Polyline, _Mapping]] = ..., wall_left: _Optional[_Union[Polyline, _Mapping]] = ..., wall_right: _Optional[_Union[Polyline, _Mapping]] = ..., runoff_left: _Optional[_Iterable[int]] = ..., runoff_right: _Optional[_Iterable[int]] = ..., zone: _Optional[_Iterable[bool]] = ..., sections: _Optional[_Iterable[_Union[Stretch, _Mapping]]] = ..., lane: _Optional[_Iterable[int]] = ...) -> None: ...
