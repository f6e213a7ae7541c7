"""What a policy sees: a versioned description that travels with every checkpoint.

The contents follow Wurman et al. (Nature 602, 2022): the car itself, course points over the next
seconds of travel, the cars ahead and behind. Frame of every vector: the car's own, x forward, y left,
both measured on the map, and for course points z up from the plane on which the car stands. Motion
has no component off that plane. Angles in radians, counter-clockwise positive.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.camera_spec import CameraSpec
from nathlon.sim.car_facts import FACTS
from nathlon.sim.errors import InputError

VERSION, ANY_CAR, PLANNED, SEEING = 2, 3, 4, 5
"""Layouts: for policies of one circuit and car; for those of any, which see what the car is; for those that
see the plan of a driver as well; and for those that see by a camera, and what a car's own sensors tell."""
NUMBERED = VERSION, ANY_CAR, PLANNED
"""Layouts without a camera."""

PLAN_PACE = 0.97
"""Share of the plan's speeds that is shown unless a spec says otherwise: they leave no margin for errors."""
TOP_SPEED = 90.0  # m/s
STEEP = 0.1
"""Range of a course point's height as a share of that of its distance."""
AHEAD_M = 80.0
BEHIND_M = 40.0
"""Opponents further away than this are not seen."""

LINES, CENTRE = 3, 1
"""Lines of the course, left edge, centre line and right edge, and the place of the centre line among them."""
POINT_SIZE = 3 * LINES
"""Numbers of a course point: x of the lines, then y, then z."""

OPPONENT = (
    ("present", 0.0, 1.0),
    ("x", -80.0, 80.0),
    ("y", -20.0, 20.0),
    ("velocity_x", -40.0, 40.0),
    ("velocity_y", -20.0, 20.0),
    ("acceleration_x", -25.0, 25.0),
    ("acceleration_y", -25.0, 25.0),
)
"""What is seen of an opponent, relative to the car: centre of mass, m, m/s, m/s^2. Absent ones are 0."""
OPPONENT_SIZE = len(OPPONENT)

# Where they stand among the numbers of an opponent.
_NAMES = [name for name, _, _ in OPPONENT]
PRESENT = _NAMES.index("present")
X, Y = _NAMES.index("x"), _NAMES.index("y")
VELOCITY_X, VELOCITY_Y = _NAMES.index("velocity_x"), _NAMES.index("velocity_y")
ACCELERATION_X, ACCELERATION_Y = _NAMES.index("acceleration_x"), _NAMES.index("acceleration_y")


@dataclass(frozen=True)
class Field:
    """One named stretch of the observation vector.

    Before standardisation its numbers lie in [low, high] `unit`; both have one value for each number.
    """

    name: str
    unit: str
    low: tuple[float, ...]
    high: tuple[float, ...]

    @property
    def size(self) -> int:
        """How many numbers the field has."""
        return len(self.low)


def _flat(name: str, size: int, unit: str, low: float, high: float) -> Field:
    return Field(name, unit, (low,) * size, (high,) * size)


OWN = (
    _flat("velocity", 2, "m/s", -10.0, 90.0),
    _flat("yaw_rate", 1, "rad/s", -1.5, 1.5),
    _flat("acceleration", 2, "m/s^2", -25.0, 25.0),
    _flat("tyre_load", 4, "N", 0.0, 8000.0),
    _flat("slip_angle", 4, "rad", -0.3, 0.3),
    _flat("progress", 2, "sin, cos of lap angle", -1.0, 1.0),
    _flat("heading_error", 1, "rad", -0.8, 0.8),
    _flat("inclination", 2, "gradient forward, left", -0.2, 0.2),
    _flat("wall_contact", 1, "flag", 0.0, 1.0),
    _flat("off_course", 1, "flag", 0.0, 1.0),
    _flat("steering", 1, "full lock", -1.0, 1.0),
    _flat("throttle", 1, "share", 0.0, 1.0),
    _flat("brake", 1, "share", 0.0, 1.0),
    _flat("car_contact", 1, "flag", 0.0, 1.0),
    _flat("slipstream", 1, "share of full draught", 0.0, 1.0),
    _flat("penalty", 1, "s to serve", 0.0, 10.0),
    _flat("tyre_wear", 4, "1 is worn out", 0.0, 1.0),
    _flat("fuel", 1, "share of the tank", 0.0, 1.0),
)
"""What a car sees of itself, with which every vector begins."""

AXLE_SLIP = _flat("axle_slip", 2, "slip ratio front, rear", -0.3, 0.3)
"""In the layout for any car, where the other one has the progress, which names a place of a circuit."""
CAR = Field("car", "see FACTS", tuple(low for _, low, _ in FACTS), tuple(high for _, _, high in FACTS))
"""In the layout for any car, the numbers that do not change in a race: the last ones."""


SENSORS = (
    *OWN[:3],
    _flat("steering", 1, "full lock", -1.0, 1.0),
    _flat("throttle", 1, "share", 0.0, 1.0),
    _flat("brake", 1, "share", 0.0, 1.0),
    _flat("last_action", 2, "throttle (+) or brake (-), steering", -1.0, 1.0),
    _flat("contact", 1, "flag", 0.0, 1.0),
    *OWN[-2:],
)
"""What an inertial unit, the wheel, the pedals and the dashboard of a car with a camera tell."""
PICTURE, NUMBERS = "picture", "sensors"
"""Parts of what a car with a camera sees."""
STATIONS_S = (0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.35, 1.75, 2.25, 2.9, 3.7, 4.7, 6.0)
"""Stations of the plan, s of travel at the present speed, denser near the car than far away."""


def _station(ahead_s: float) -> tuple[float, ...]:
    """Greatest numbers of a station, which is given as OFFSET, y, heading, speed, curvature and steering."""
    return 8.0, 4.0 + 30.0 * ahead_s, min(0.3 + 0.5 * ahead_s, 1.5), min(0.1 + 0.15 * ahead_s, 0.6), 0.03, 0.5


STATION_SIZE = len(_station(0.0))
ERRORS = 5
"""How far the car is off the plan: in offset, course, speed, sideslip and yaw rate, between -1 and 1."""
_PLAN = tuple(most for ahead_s in STATIONS_S for most in _station(ahead_s)) + (1.0,) * ERRORS
PLAN = Field("plan", "see STATIONS_S", tuple(-most for most in _PLAN), _PLAN)
"""In the layout with a plan: its stations, then the car's errors."""
WALLS = _flat("walls", 2, "room left, right, saturated", 0.0, 1.0)
"""In the layout with a plan, if asked for: r / (ROOM_M + r), r metres from the car's centre to a wall."""
ROOM_M = 5.0


@dataclass(frozen=True)
class ObservationSpec:
    """Layout and scaling of an observation.

    With a camera, an observation is a picture and the numbers of SENSORS: no course points, no opponents,
    nothing that names a place.

    Attributes:
        course_points: points on each of left edge, centre line and right edge (the reference has 60);
            the first is beside the car, the others evenly ahead of it. Each is given as x of left,
            centre and right, then y, then z of the three. With none, there is no such field.
        horizon_s: seconds of travel at the present speed that the course points span.
        cars_ahead, cars_behind: length of the two lists of opponents, nearest first.
        version: of the layout: one of NUMBERED, with a camera SEEING.
        plan_pace: share of the plan's speeds that is shown, where there is a plan.
        practised_by: id of the policy that has practised the plan; empty where it is the built-in driver's.
            Of a policy that drives, and in no card.
        walls: whether the room up to the walls is seen beside a plan.
        camera: by which the car sees; None for numbers alone.
    """

    course_points: int = 60
    horizon_s: float = 6.0
    cars_ahead: int = 4
    cars_behind: int = 4
    version: int = VERSION
    plan_pace: float = PLAN_PACE
    practised_by: str = ""
    walls: bool = False
    camera: CameraSpec | None = None

    def __post_init__(self) -> None:
        if self.camera is not None:
            self._see()
        elif self.version not in NUMBERED:
            raise InputError(
                f"observation spec: version is {self.version}, "
                f"this simulator makes versions {', '.join(map(str, NUMBERED))}, and {SEEING} with a camera"
            )
        if not 0.5 <= self.plan_pace <= 1.5:
            raise InputError(f"observation spec: plan_pace is {self.plan_pace!r}, expected 0.5 to 1.5")
        if self.plan_pace != PLAN_PACE and not self.planned:
            raise InputError(f"observation spec: plan_pace is given, expected version {PLANNED} beside it")
        if not isinstance(self.walls, bool):
            raise InputError(f"observation spec: walls is {self.walls!r}, expected true or false")
        if self.walls and not self.planned:
            raise InputError(f"observation spec: walls are given, expected version {PLANNED} beside them")
        for name in ("course_points", "cars_ahead", "cars_behind"):
            value = getattr(self, name)
            if not isinstance(value, int) or not 0 <= value <= 500:
                raise InputError(
                    f"observation spec: {name} is {value!r}, expected a whole number from 0 to 500"
                )
        if not 0.0 < self.horizon_s <= 60.0:
            raise InputError(f"observation spec: horizon_s is {self.horizon_s!r}, expected 0 to 60 s")

    def _see(self) -> None:
        """Leave out what a camera shows."""
        if not isinstance(self.camera, CameraSpec):
            raise InputError(f"observation spec: camera is {self.camera!r}, expected a CameraSpec")
        for name, seen in (("course_points", 0), ("cars_ahead", 0), ("cars_behind", 0), ("version", SEEING)):
            value, default = getattr(self, name), type(self).__dataclass_fields__[name].default
            if value not in (seen, default):
                raise InputError(f"observation spec: {name} is {value!r}, expected {seen} beside a camera")
            object.__setattr__(self, name, seen)

    @cached_property
    def fields(self) -> tuple[Field, ...]:
        """The fields in the order in which they stand in the vector."""
        if self.camera is not None:
            return SENSORS
        # Point i lies i/n of the horizon ahead, so its range grows with i: near points stay sharp.
        reach = tuple(
            share * (15.0 + point / self.course_points * self.horizon_s * TOP_SPEED)
            for point in range(self.course_points)
            for share in (*(1.0,) * 2 * LINES, *(STEEP,) * LINES)
        )
        course = (Field("course", "m", tuple(-x for x in reach), reach),) if reach else ()
        lists = tuple(
            Field(
                f"cars_{where}",
                "see OPPONENT",
                tuple(low for _, low, _ in OPPONENT) * count,
                tuple(high for _, _, high in OPPONENT) * count,
            )
            for where, count in (("ahead", self.cars_ahead), ("behind", self.cars_behind))
            if count
        )
        if self.version == VERSION:
            return OWN + course + lists
        own = tuple(AXLE_SLIP if field.name == "progress" else field for field in OWN)
        planned = (PLAN,) if self.planned else ()
        return (*own, *course, *lists, *planned, *((WALLS,) if self.walls else ()), CAR)

    @property
    def planned(self) -> bool:
        """Whether a plan is seen."""
        return self.version == PLANNED

    def practising(self, policy_id: str) -> ObservationSpec:
        """What a policy sees that practises: all of the speeds of a plan of its own."""
        return replace(self, plan_pace=1.0, practised_by=policy_id)

    @property
    def facts(self) -> int:
        """How many of the numbers, the last ones, do not change in a race."""
        return 0 if self.version == VERSION else CAR.size

    @cached_property
    def size(self) -> int:
        """How many numbers there are."""
        return sum(field.size for field in self.fields)

    def slice(self, name: str) -> slice:
        """Where the named field stands in the vector.

        Raises:
            KeyError: if there is no such field.
        """
        start = 0
        for field in self.fields:
            if field.name == name:
                return slice(start, start + field.size)
            start += field.size
        raise KeyError(name)

    def start(self, name: str) -> int:
        """Where the named field begins in the vector.

        Raises:
            KeyError: if there is no such field.
        """
        return int(self.slice(name).start)

    def blank(self, cars: int) -> NDArray[Any]:
        """Observations of so many cars, all zeros.

        Returns:
            (cars, size) float32; with a camera (cars,) records of `sensors`, (size,) float32, and `picture`,
            (height, width, channels) uint8.
        """
        if self.camera is None:
            return np.zeros((cars, self.size), np.float32)
        return np.zeros(cars, [(NUMBERS, np.float32, (self.size,)), (PICTURE, np.uint8, self.camera.shape)])

    def to_dict(self) -> dict[str, Any]:
        """The spec as plain JSON values; the camera only if there is one, and the pace only of a plan."""
        told = asdict(self)
        del told["practised_by"]
        if self.camera is None:
            del told["camera"]
        if not self.planned:
            del told["plan_pace"]  # cards of policies without a plan stay as they were
        if not self.walls:
            del told["walls"]
        return told

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> ObservationSpec:
        """The spec from plain JSON values.

        Raises:
            InputError: naming the field that is unknown or out of range.
        """
        unknown = set(data) - set(cls.__dataclass_fields__) | {"practised_by"} & set(data)
        if unknown:
            raise InputError(f"observation spec: unknown field {sorted(unknown)[0]!r}")
        for name, value in data.items():
            if isinstance(value, bool) and name != "walls":  # which Python takes for 0 and 1
                raise InputError(f"observation spec: {name} is {value}, expected a number")
        camera = data.get("camera")
        seeing = {} if camera is None else {"camera": CameraSpec.from_dict(camera)}
        try:
            return cls(**(data | seeing))
        except TypeError as error:
            raise InputError(f"observation spec: {error}") from None

    def describe(self) -> str:
        """The layout as a table in plain text, one field a line."""
        lines = [f"observation spec, version {self.version}, {self.size} numbers"]
        if self.camera is not None:
            height, width, channels = self.camera.shape
            lines[0] += f" beside a picture of {height} x {width} x {channels} bytes"
        start = 0
        for field in self.fields:
            stop = start + field.size
            span = f"[{min(field.low):g}, {max(field.high):g}]"
            lines.append(f"{start:5d}:{stop:<5d} {field.name:<14} {span} {field.unit}")
            start = stop
        return "\n".join(lines)

    @cached_property
    def scaling(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Mean and deviation of a uniform distribution over each number's range, each (size,) float32."""
        low = np.concatenate([f.low for f in self.fields])
        high = np.concatenate([f.high for f in self.fields])
        return ((low + high) / 2).astype(np.float32), ((high - low) / np.sqrt(12.0)).astype(np.float32)


def flattened(seen: NDArray[Any]) -> NDArray[np.float32]:
    """Observations as one row of numbers each, in the order of `gymnasium.spaces.flatten`."""
    if seen.dtype.names is None:
        return seen
    pictures = seen[PICTURE].reshape(len(seen), -1)
    return np.concatenate([pictures, seen[NUMBERS]], axis=1, dtype=np.float32)
