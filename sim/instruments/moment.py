"""An agent step as instruments see it."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.car import Car
from nathlon.sim.expressions import Values
from nathlon.sim.track import CURVATURE, KERB_LEFT, KERB_RIGHT, LEFT, RIGHT, Track

FAR_M = 500.0
"""The gap to a car that is farther away, or is not there."""

Records = NDArray[np.void]
Indices = NDArray[np.int64]


class Transition(NamedTuple):
    """An agent step of races.

    Attributes:
        before, after: (races, cars) CAR_STATE on both sides of it.
        contacts: (n,) CONTACT, those that began in it.
        races: (n,) int64, in which races.
    """

    before: Records
    after: Records
    contacts: Records
    races: Indices


class Tyres(NamedTuple):
    """Where tyres stand, each (races, cars, 4).

    Attributes:
        beyond: how far they are beyond the edge of the road on their side, m; negative on the road.
        kerb: width of the kerb there, m.
    """

    beyond: Values
    kerb: Values


class Neighbours(NamedTuple):
    """The nearest car on one side along the centre line, each (races, cars).

    Attributes:
        gap: to its centre, m; FAR_M where there is none so near.
        gained: by how much the gap has shrunk in the step, m.
    """

    gap: Values
    gained: Values


class MeasuredStep:
    """A step as the instruments see it; what several quantities need is computed once."""

    def __init__(self, track: Track, car: Car, step_s: float, step: Transition) -> None:
        """A step of `step_s` seconds of cars of a model on a circuit."""
        self.step_s = step_s
        self.before, self.after = step.before, step.after
        self._track, self._car, self._step = track, car, step

    def gained(self, name: str) -> Values:
        """By how much a field has grown in the step."""
        return np.asarray(self.after[name] - self.before[name], np.float64)

    def rate(self, name: str) -> Values:
        """The same in a second."""
        return self.gained(name) / self.step_s

    def begun(self, *roles: str, fault: bool = False) -> Values:
        """Contacts that began in the step with the cars in some roles, or by their fault."""
        counted = np.zeros(self.after.shape)
        for role in roles:
            contacts = self._step.contacts
            charged = contacts["fault"] == contacts[role] if fault else np.ones(len(contacts), np.bool_)
            np.add.at(counted, (self._step.races[charged], contacts[role][charged]), 1.0)
        return counted

    @cached_property
    def line(self) -> NDArray[np.float64]:
        """Rows of the circuit's table beside the cars, (races, cars, TABLE_WIDTH)."""
        return self._track.table[self.after["row"]]

    @cached_property
    def tyres(self) -> Tyres:
        """Where the tyres stand, as `nathlon.sim.physics.course.stand_on` finds it."""
        body, cars, line = self._car.body, self.after, self.line[..., None, :]
        x = np.array([body.front_axle_m] * 2 + [-body.rear_axle_m] * 2)
        y = np.array([1.0, -1.0] * 2) * np.repeat([body.front_track_m, body.rear_track_m], 2) / 2.0
        error = cars["heading_error"][..., None]
        sine, cosine = np.sin(error), np.cos(error)
        ahead = x * cosine - y * sine
        lateral = cars["lateral"][..., None] + x * sine + y * cosine - 0.5 * line[..., CURVATURE] * ahead**2
        left = lateral > 0.0
        return Tyres(
            np.where(left, lateral - line[..., LEFT], -lateral - line[..., RIGHT]),
            np.where(left, line[..., KERB_LEFT], line[..., KERB_RIGHT]),
        )

    @cached_property
    def gaps(self) -> NDArray[np.float64]:
        """Along the centre line from each car to each other that drives, the shorter way round, m.

        (races, cars, cars), nan where there is none.
        """
        progress, length = self.after["progress"], self._track.length
        gap = progress[:, None, :] - progress[:, :, None]
        gap -= np.round(gap / length) * length
        there = self.after["driving"][:, None, :] & ~np.eye(gap.shape[1], dtype=np.bool_)
        return np.where(there, gap, np.nan)

    def neighbours(self, sign: float) -> Neighbours:
        """The nearest cars ahead (1.0) or behind (-1.0); one beside counts as ahead."""
        gap = sign * self.gaps
        on_side = gap >= 0.0 if sign > 0.0 else gap > 0.0
        gap = np.where(on_side & (gap < FAR_M), gap, FAR_M)
        nearest = gap.argmin(axis=2)[..., None]
        gained = self.gained("progress")
        other = np.take_along_axis(gained[:, None, :], nearest, axis=2)[..., 0]
        least = np.take_along_axis(gap, nearest, axis=2)[..., 0]
        return Neighbours(least, np.where(least < FAR_M, sign * (gained - other), 0.0))

    def nearest(self) -> Values:
        """Distance to the centre of the nearest car that drives, m."""
        x, y = self.after["x"], self.after["y"]
        apart = np.hypot(x[:, None, :] - x[:, :, None], y[:, None, :] - y[:, :, None])
        return np.where(np.isnan(self.gaps), FAR_M, apart).min(axis=2)
