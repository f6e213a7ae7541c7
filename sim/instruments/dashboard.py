"""The quantities that can be read of racing cars, and how."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nathlon.sim.expressions import Quantity, Values
from nathlon.sim.instruments.moment import FAR_M, MeasuredStep, Records
from nathlon.sim.track import CURVATURE

Read = Callable[[MeasuredStep], NDArray[np.generic]]


class Instrument(NamedTuple):
    """A quantity and how it is read, (races, cars); for the others see `Quantity`."""

    unit: str
    low: float
    high: float
    meaning: str
    read: Read

    @property
    def quantity(self) -> Quantity:
        """What it shows."""
        return Quantity(self.unit, self.low, self.high, self.meaning)


def _after(field: str) -> Read:
    return lambda moment: moment.after[field]


def _gained(field: str) -> Read:
    return lambda moment: moment.gained(field)


def _speed(cars: Records) -> Values:
    return np.hypot(cars["velocity_x"], cars["velocity_y"])


def _slip(cars: Records) -> Values:
    return np.asarray((np.minimum(np.abs(cars["slip_ratio"]), 1.0) * np.abs(cars["slip_angle"])).sum(axis=-1))


def _edge(moment: MeasuredStep) -> Values:
    return np.asarray(-moment.tyres.beyond.max(axis=-1))


def _on_kerb(moment: MeasuredStep) -> Values:
    beyond, kerb = moment.tyres
    return np.asarray(((beyond > 0.0) & (beyond <= kerb)).sum(axis=-1))


def _out(moment: MeasuredStep) -> Values:
    beyond, kerb = moment.tyres
    return np.asarray(((beyond > 0.0) & (beyond > kerb)).sum(axis=-1))


def _wear(moment: MeasuredStep) -> Values:
    worn: Values = moment.gained("wear").mean(axis=-1) / moment.step_s
    return worn


def _closing(sign: float) -> Read:
    return lambda moment: moment.neighbours(sign).gained / moment.step_s


INSTRUMENTS: Mapping[str, Instrument] = {
    "step": Instrument("s", 0.01, 1.0, "length of the step", lambda m: np.full(m.after.shape, m.step_s)),
    "progress": Instrument("m", -50, 150, "centre line gained in the step", _gained("progress")),
    "speed": Instrument("m/s", 0, 150, "over the ground", lambda m: _speed(m.after)),
    "speed_before": Instrument("m/s", 0, 150, "the same before the step", lambda m: _speed(m.before)),
    "lateral": Instrument("m", -500, 500, "left of the centre line", _after("lateral")),
    "edge": Instrument(
        "m", -500, 50, "from the tyre nearest to an edge of the road to that edge; below 0 beyond", _edge
    ),
    "heading_error": Instrument("rad", -4, 4, "heading less the centre line's", _after("heading_error")),
    "curvature": Instrument(
        "1/m", -1, 1, "of the centre line, + is to the left", lambda m: m.line[..., CURVATURE]
    ),
    "kerb": Instrument("1", 0, 4, "tyres on a kerb", _on_kerb),
    "out": Instrument("1", 0, 4, "tyres beyond road and kerbs", _out),
    "off_course": Instrument(
        "s", 0, 1, "time in the step with three tyres or more there", _gained("off_course_s")
    ),
    "wall": Instrument("s", 0, 1, "time in the step at a wall", _gained("wall_s")),
    "yaw_rate": Instrument("rad/s", -50, 50, "turning, + is to the left", _after("yaw_rate")),
    "acceleration_ahead": Instrument("m/s^2", -300, 300, "along the car", _after("acceleration_x")),
    "acceleration_left": Instrument("m/s^2", -300, 300, "across the car", _after("acceleration_y")),
    "throttle": Instrument("1", 0, 1, "as applied", _after("throttle")),
    "brake": Instrument("1", 0, 1, "as applied", _after("brake")),
    "steering": Instrument("rad", -2, 2, "angle of the front wheels, + is to the left", _after("steering")),
    "steering_rate": Instrument(
        "rad/s", -50, 50, "its change, of the whole step", lambda m: m.rate("steering")
    ),
    "tyre_slip": Instrument(
        "1", 0, 20, "slip ratio, at most 1, times slip angle, summed over the tyres", lambda m: _slip(m.after)
    ),
    "tyre_wear": Instrument(
        "1", 0, 10, "mean of the tyres, 1 is worn out", lambda m: m.after["wear"].mean(axis=-1)
    ),
    "wear_rate": Instrument("1/s", 0, 10, "its growth, of the whole step", _wear),
    "fuel": Instrument("kg", 0, 1000, "in the tank", _after("fuel")),
    "mass": Instrument("kg", 0, 20000, "of the car with fuel", _after("mass")),
    "slipstream": Instrument("1", 0, 1, "share of the full draught", _after("draught")),
    "gap_ahead": Instrument(
        "m",
        0,
        FAR_M,
        "to the next car ahead, between centres along the centre line",
        lambda m: m.neighbours(1.0).gap,
    ),
    "gap_behind": Instrument(
        "m", 0, FAR_M, "to the next car behind, alike", lambda m: m.neighbours(-1.0).gap
    ),
    "closing_ahead": Instrument(
        "m/s", -300, 300, "by which the gap ahead shrinks, of the whole step; 0 without a car", _closing(1.0)
    ),
    "closing_behind": Instrument("m/s", -300, 300, "by which the gap behind shrinks, alike", _closing(-1.0)),
    "nearest": Instrument("m", 0, FAR_M, "to the nearest car, between centres", MeasuredStep.nearest),
    "touching": Instrument("1", 0, 1, "1 in contact with a car, or else 0", _after("car_contact")),
    "contacts": Instrument(
        "1", 0, 20, "with cars, that began in the step", lambda m: m.begun("behind", "ahead")
    ),
    "contacts_at_fault": Instrument(
        "1",
        0,
        20,
        "of these, those that the stewards find its fault",
        lambda m: m.begun("behind", "ahead", fault=True),
    ),
    "penalty": Instrument("s", 0, 1000, "still to serve", _after("penalty_s")),
}
"""All of them by name. Without a word about it, they show what holds at the end of a step."""

AMONG_CARS = frozenset({"gap_ahead", "gap_behind", "closing_ahead", "closing_behind", "nearest"})
"""Those that take the other cars of the race to read; contacts are noted beside the states."""
