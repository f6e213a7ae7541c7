"""The reward: a weighted sum of components over arrays of transitions (Wurman et al., 2022, table 1), and an
expression of your own (`nathlon.sim.expressions`).

Penalties for leaving the road and touching the wall are charged on the speed that was brought
there, not on the speed that is left: otherwise the wall becomes a brake.

`before` and `after` are (races, cars) CAR_STATE records of the state on both sides of an agent step;
`contacts` are (n,) CONTACT records of the contacts that began in it, of the races in `where`, (n,).
All components are (races, cars).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from nathlon.sim.errors import InputError
from nathlon.sim.expressions import pure_number
from nathlon.sim.instruments import QUANTITIES, Instruments, Transition
from nathlon.sim.state import REAR_END, SIDE_SWIPE
from nathlon.sim.track import SECTION

PASSING_AHEAD_M = 40.0
PASSING_BEHIND_M = 20.0
CONTACTS = ("contact", "rear_end", "unsporting", "at_fault")
"""Components that charge contacts with cars."""
EXPRESSION = "expression"
"""The component that an expression gives; its weight is 1."""

Records = NDArray[np.void]
Indices = NDArray[np.int64]
Rewards = NDArray[np.float64]


def _readable(text: str) -> str:
    try:
        return pure_number(text, QUANTITIES).text
    except InputError as error:
        raise ValueError(str(error)) from None


class RewardWeights(BaseModel):
    """Weights of the components; see the functions of the same names.

    Attributes:
        off_course_in: by name of a section, the factor by which `off_course` counts more there.
        expression: of `nathlon.sim.instruments.QUANTITIES`, a pure number; where there is one, the components
            whose weights are not given count nothing.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    progress: float = 0.2
    off_course: float = 0.006
    wall: float = 0.03
    wall_touch: float = 0.3
    tyre_slip: float = 0.0
    steering: float = 0.0
    passing: float = 0.0
    contact: float = 0.0
    rear_end: float = 0.0
    unsporting: float = 0.0
    at_fault: float = 0.0
    off_course_in: dict[str, Annotated[float, Field(ge=0)]] = {}
    expression: Annotated[str, AfterValidator(_readable)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _expression_alone(cls, given: Any) -> Any:
        if not isinstance(given, dict) or given.get(EXPRESSION) is None:
            return given
        weights = {name: 0.0 for name, field in cls.model_fields.items() if field.annotation is float}
        return weights | given


def progress(before: Records, after: Records) -> Rewards:
    """Metres of centre line gained, none while off course."""
    return np.where(after["off_course"], 0.0, after["progress"] - before["progress"])


def off_course(before: Records, after: Records, factor: NDArray[np.float64] | float = 1.0) -> Rewards:
    """Minus time off course times the square of the speed before the step, s m^2/s^2.

    Args:
        before, after: see above.
        factor: by which it counts more where the car is, (races, cars).
    """
    return -(after["off_course_s"] - before["off_course_s"]) * _speed_squared(before) * factor


def wall(before: Records, after: Records) -> Rewards:
    """Minus time at the wall times the square of the speed before the step, s m^2/s^2."""
    return -(after["wall_s"] - before["wall_s"]) * _speed_squared(before)


def wall_touch(after: Records) -> Rewards:
    """-1 in contact with a wall; not among the components of the reference."""
    return -after["wall_contact"].astype(np.float64)


def tyre_slip(after: Records) -> Rewards:
    """Minus the sum over tyres of min(abs(slip ratio), 1) times abs(slip angle)."""
    slip = np.minimum(np.abs(after["slip_ratio"]), 1.0) * np.abs(after["slip_angle"])
    return -slip.sum(axis=2)


def steering(before: Records, after: Records) -> Rewards:
    """Minus the square of the change of the steering angle, rad^2; not among the components of the reference.

    To steer to and fro with every step costs a hundredth of a lap's time, less than critics can tell.
    """
    return -np.square(after["steering"] - before["steering"])


def passing(before: Records, after: Records, lap_m: float) -> Rewards:
    """Ground gained on each opponent within 20 m behind and 40 m ahead, m; ground lost counts alike."""
    was = before["progress"]
    gained = after["progress"] - was
    gap = was[:, None, :] - was[:, :, None]
    gap -= np.round(gap / lap_m) * lap_m
    near = (gap > -PASSING_BEHIND_M) & (gap < PASSING_AHEAD_M)
    near &= before["driving"][:, None, :] & ~np.eye(was.shape[1], dtype=np.bool_)
    return ((gained[:, :, None] - gained[:, None, :]) * near).sum(axis=2)


def contact(after: Records) -> Rewards:
    """-1 in contact with a car."""
    return -after["car_contact"].astype(np.float64)


def rear_end(contacts: Records, where: Indices, shape: tuple[int, ...]) -> Rewards:
    """Minus the square of the relative speed of contacts begun while behind and faster, m^2/s^2.

    Args:
        contacts, where: see above.
        shape: (races, cars).
    """
    penalty = np.zeros(shape)
    if not len(contacts):
        return penalty
    charged = contacts["faster"] == contacts["behind"]
    relative = contacts["relative_x"] ** 2 + contacts["relative_y"] ** 2
    np.subtract.at(penalty, (where[charged], contacts["behind"][charged]), relative[charged])
    return penalty


def unsporting(
    contacts: Records, where: Indices, curved: NDArray[np.bool_], shape: tuple[int, ...]
) -> Rewards:
    """-1 for each contact begun in an unsporting way.

    That is to rear-end or side-swipe on a straight, and in a curve any contact but being rear-ended.
    The car behind rear-ends; a side-swipe is the fault that the stewards find, or that of both.

    Args:
        contacts, where: see above.
        curved: (sections + 1,) whether each section of the circuit is a curve, and what lies outside them.
        shape: (races, cars).
    """
    penalty = np.zeros(shape)
    if not len(contacts):
        return penalty
    geometry, fault = contacts["geometry"], contacts["fault"]
    for role in ("behind", "ahead"):
        car, section = contacts[role], contacts[f"section_{role}"]
        swiped = (geometry == SIDE_SWIPE) & ((fault == car) | (fault < 0))
        charged = np.where(curved[section], geometry != REAR_END, swiped)
        if role == "behind":
            charged |= geometry == REAR_END
        np.subtract.at(penalty, (where[charged], car[charged]), 1.0)
    return penalty


def at_fault(before: Records, after: Records) -> Rewards:
    """-1 for each contact begun that the stewards lay to the car; not among those of the reference."""
    return (before["contacts_at_fault"] - after["contacts_at_fault"]).astype(np.float64)


def _speed_squared(cars: Records) -> Rewards:
    return cars["velocity_x"] ** 2 + cars["velocity_y"] ** 2


class Reward:
    """The components on one circuit and their weighted sum."""

    def __init__(self, weights: RewardWeights, instruments: Instruments) -> None:
        """A reward.

        Args:
            weights: of the components.
            instruments: for the circuit and car that are driven.

        Raises:
            InputError: if a weight names a section that the circuit does not have.
        """
        track = instruments.track
        names = [section.name for section in track.sections]
        for name in weights.off_course_in:
            if name not in names:
                raise InputError(
                    f"reward: off_course_in.{name} is not a section of {track.name}, "
                    f"expected one of {', '.join(names)}"
                )
        self._weights = weights
        self._track, self._instruments = track, instruments
        self._expression = weights.expression and pure_number(weights.expression, QUANTITIES)
        # The last element is for what lies outside all sections: their index is -1.
        self._factor = np.array([*(weights.off_course_in.get(name, 1.0) for name in names), 1.0])
        self._curved = np.array([*(section.kind != "straight" for section in track.sections), False])

    def components(
        self, before: Records, after: Records, contacts: Records, where: Indices
    ) -> dict[str, Rewards]:
        """Every component, unweighted, by name; for the arguments see this module."""
        section = self._track.table[after["row"], SECTION].astype(np.int64)
        own = {}
        if self._expression:
            step = Transition(before, after, contacts, where)
            own[EXPRESSION] = self._expression(self._instruments.read(self._expression.names, step))
        return {
            "progress": progress(before, after),
            "off_course": off_course(before, after, self._factor[section]),
            "wall": wall(before, after),
            "wall_touch": wall_touch(after),
            "tyre_slip": tyre_slip(after),
            "steering": steering(before, after),
            "passing": passing(before, after, self._track.length),
            "contact": contact(after),
            "rear_end": rear_end(contacts, where, after.shape),
            "unsporting": unsporting(contacts, where, self._curved, after.shape),
            "at_fault": at_fault(before, after),
            **own,
        }

    def total(self, components: Mapping[str, Rewards]) -> Rewards:
        """The weighted sum of the given components."""
        weighted = [
            value if name == EXPRESSION else getattr(self._weights, name) * value
            for name, value in components.items()
        ]
        return np.sum(weighted, axis=0)
