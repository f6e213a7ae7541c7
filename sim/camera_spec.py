"""What a camera on a car is like: a description that travels with every checkpoint that sees by it."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any, NamedTuple

from nathlon.sim.errors import InputError


class Mount(NamedTuple):
    """Where a camera sits, from the centre of mass's place on the road, in the plane of the road.

    Attributes:
        forward: m ahead.
        height: m above the road.
        pitch: rad by which it looks down.
        sees_itself: whether its own car is in the picture.
    """

    forward: float
    height: float
    pitch: float
    sees_itself: bool


MOUNTS = {
    "cockpit": Mount(0.3, 1.15, math.radians(5.0), False),
    "roof": Mount(0.0, 1.9, math.radians(7.0), False),
    "chase": Mount(-6.5, 2.6, math.radians(12.0), True),
}
CHANNELS = (1, 3)
LEAST_SIDE, LONGEST_SIDE = 16, 256
FIELD_OF_VIEW = 20.0, 140.0
MOST_NOISE, MOST_BLUR = 64.0, 4


@dataclass(frozen=True)
class CameraSpec:
    """A camera.

    Attributes:
        width, height: of the picture, pixels.
        field_of_view: from the left to the right side of the picture, degrees.
        vertical_field_of_view: from its top to its bottom, degrees; pixels need not be square, since most of
            what matters lies near the horizon.
        mount: where it sits, a name of MOUNTS.
        channels: 3 for red, green and blue, 1 for grey.
        noise: standard deviation of each number, of 255; it depends on the seed, the time and the car.
        blur: how often each pixel is mixed with its neighbours.
        seed: of the noise.
    """

    width: int = 64
    height: int = 64
    field_of_view: float = 75.0
    vertical_field_of_view: float = 36.0
    mount: str = "cockpit"
    channels: int = 3
    noise: float = 0.0
    blur: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("width", LEAST_SIDE, LONGEST_SIDE),
            ("height", LEAST_SIDE, LONGEST_SIDE),
            ("blur", 0, MOST_BLUR),
            ("seed", 0, 2**32 - 1),
        ):
            value = getattr(self, name)
            if type(value) is not int or not low <= value <= high:
                raise InputError(f"camera: {name} is {value!r}, expected a whole number from {low} to {high}")
        for name, least, most in (
            ("field_of_view", *FIELD_OF_VIEW),
            ("vertical_field_of_view", *FIELD_OF_VIEW),
            ("noise", 0.0, MOST_NOISE),
        ):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
                raise InputError(f"camera: {name} is {value!r}, expected {least:g} to {most:g}")
        if self.mount not in MOUNTS:
            raise InputError(f"camera: mount is {self.mount!r}, expected one of {', '.join(MOUNTS)}")
        if type(self.channels) is not int or self.channels not in CHANNELS:
            raise InputError(f"camera: channels is {self.channels!r}, expected 1 (grey) or 3 (colour)")

    @property
    def shape(self) -> tuple[int, int, int]:
        """Of a picture: height, width, channels."""
        return self.height, self.width, self.channels

    @property
    def focal(self) -> tuple[float, float]:
        """Distance from which the picture is to be seen, in pixels' widths and in their heights."""
        return (
            self.width / 2.0 / math.tan(math.radians(self.field_of_view) / 2.0),
            self.height / 2.0 / math.tan(math.radians(self.vertical_field_of_view) / 2.0),
        )

    def to_dict(self) -> dict[str, Any]:
        """The spec as plain JSON values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Any) -> CameraSpec:
        """The spec from plain JSON values.

        Raises:
            InputError: naming the field that is unknown or out of range.
        """
        if not isinstance(data, dict):
            raise InputError(f"camera: is {data!r}, expected an object")
        unknown = set(data) - {field.name for field in fields(cls)}
        if unknown:
            raise InputError(f"camera: unknown field {sorted(unknown)[0]!r}")
        return cls(**data)
