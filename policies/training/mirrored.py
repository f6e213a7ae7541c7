"""The mirror image of what a car sees and does.

Cars have no better side. So what a teacher says on a circuit it says on the mirror image too, the other way
round, and a pupil learns both from one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from torch import Tensor, from_numpy

from nathlon.sim.observation import OPPONENT, STATION_SIZE, STATIONS_S, ObservationSpec


class Mirror(NamedTuple):
    """What becomes of observations.

    Attributes:
        places: (size,) int64, from where each number comes.
        signs: (size,) float32, by which it is multiplied.
        shift: (size,) float32, what is added: standardised numbers need not be centred at nought.
    """

    places: Tensor
    signs: Tensor
    shift: Tensor

    def seen(self, seen: Tensor) -> Tensor:
        """The mirror image of standardised observations, (.., size)."""
        return seen[..., self.places] * self.signs + self.shift


class _Image(NamedTuple):
    """What becomes of the numbers of a field, or of parts of as many: from where each comes, and its sign."""

    places: tuple[int, ...]
    signs: tuple[int, ...]


def _stays(*signs: int) -> _Image:
    return _Image(tuple(range(len(signs))), signs)


_WHEELS = 1, 0, 3, 2
_STATION = _stays(-1, -1, -1, 1, -1, -1)
_ERRORS = -1, -1, 1, -1, -1
_OPPONENT = _stays(*(-1 if name.endswith("y") else 1 for name, _, _ in OPPONENT))
_IMAGES = {
    "velocity": _stays(1, -1),
    "yaw_rate": _stays(-1),
    "acceleration": _stays(1, -1),
    "tyre_load": _Image(_WHEELS, (1, 1, 1, 1)),
    "slip_angle": _Image(_WHEELS, (-1, -1, -1, -1)),
    "heading_error": _stays(-1),
    "inclination": _stays(1, -1),
    "steering": _stays(-1),
    "tyre_wear": _Image(_WHEELS, (1, 1, 1, 1)),
    "course": _Image((2, 1, 0, 5, 4, 3, 8, 7, 6), (1, 1, 1, -1, -1, -1, 1, 1, 1)),
    "cars_ahead": _OPPONENT,
    "cars_behind": _OPPONENT,
    "plan": _stays(*_STATION.signs * len(STATIONS_S), *_ERRORS),
    "walls": _Image((1, 0), (1, 1)),
}
"""Of the fields that do not stay as they are."""
assert len(_STATION.signs) == STATION_SIZE


def mirror(spec: ObservationSpec) -> Mirror:
    """What becomes of observations of numbers."""
    places, signs = np.arange(spec.size), np.ones(spec.size, np.float32)
    for field in spec.fields:
        if field.name in _IMAGES:
            image, where = _IMAGES[field.name], spec.slice(field.name)
            groups = places[where].reshape(-1, len(image.places))
            places[where] = groups[:, image.places].ravel()
            signs[where] = np.resize(image.signs, field.size)
    mean, deviation = spec.scaling
    return Mirror(*map(from_numpy, (places, signs, (signs * mean[places] - mean) / deviation)))


def turned(actions: Tensor) -> Tensor:
    """The mirror image of pedals and steering, (.., 2)."""
    return actions * actions.new_tensor([1.0, -1.0])
