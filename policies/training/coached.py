"""Learning from a coach: moments before the sections where a car lost most become starts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from nathlon.sim.conditions import Start
from nathlon.sim.data_file import Section
from nathlon.sim.episode import Episodes, Moment
from nathlon.sim.errors import InputError
from nathlon.sim.scenario_start import Angle, Metres, Speed
from nathlon.sim.untrusted_file import read_text
from nathlon.sim.validation import read_json

SHARE = 0.2
"""Of the starts of races of one car that are a coach's."""
EACH = 16
"""Moments made of each start state."""
JITTER_M, JITTER_M_S = 0.3, 1.0
"""How far they lie apart, along and across the road and in speed: no two races begin alike."""


class CoachedStart(Section):
    """A moment of a coached lap; the fields of `nathlon.sim.scenario_start.FrozenCar`, and

    Attributes:
        section: before which it is.
        lost_s: what was lost there; starts are drawn in proportion.
    """

    section: str
    lost_s: Annotated[float, Field(gt=0, le=1e4)]
    progress_m: Metres
    lateral_m: Metres
    heading_rad: Angle
    speed_m_s: Speed
    side_speed_m_s: Speed
    yaw_rate_rad_s: Annotated[float, Field(ge=-20, le=20)]


class _Raced(BaseModel):
    circuit: str
    car: str


class _Facts(BaseModel):
    """Of what `nathlon coach` has left, that which matters here."""

    model_config = ConfigDict(extra="ignore")

    raced: _Raced
    starts: tuple[CoachedStart, ...]


def read_coach(path: Path, circuit: str, car: str) -> tuple[CoachedStart, ...]:
    """The start states in a file of `nathlon coach`, coach.json.

    Raises:
        InputError: if it cannot be read, is of another circuit or car, or holds none.
    """
    facts = read_json(read_text(path, "facts of the coach"), _Facts, path)
    for field, found, wanted in (("circuit", facts.raced.circuit, circuit), ("car", facts.raced.car, car)):
        if found != wanted:
            raise InputError(f"{path}: {field} is {found!r}, expected {wanted!r} as in the training")
    if not facts.starts:
        raise InputError(f"{path}: starts is empty, expected a lap that lost time in a bend")
    return facts.starts


class Coached:
    """Moments that a coach's start states give in some races of one car.

    Args:
        episodes: the races; the first one is used to make the moments, and has to be started afterwards.
        starts: the start states.
        rng: of the jitter.
    """

    def __init__(self, episodes: Episodes, starts: Sequence[CoachedStart], rng: np.random.Generator) -> None:
        self._moments: list[Moment] = []
        for start in starts:
            for along, across, faster in rng.uniform(-1.0, 1.0, (EACH, 3)):
                episodes.world.reset(
                    0,
                    Start(
                        distance=np.array([start.progress_m + JITTER_M * along]),
                        lateral=np.array([start.lateral_m + JITTER_M * across]),
                        heading=np.array([start.heading_rad]),
                        speed=np.array([start.speed_m_s + JITTER_M_S * faster]),
                        finish=np.array([np.inf]),
                        side_speed=np.array([start.side_speed_m_s]),
                        yaw_rate=np.array([start.yaw_rate_rad_s]),
                    ),
                )
                self._moments.append(episodes.moment().of(0))
        weights = np.repeat([start.lost_s for start in starts], EACH)
        self._chances = weights / weights.sum() if len(weights) else weights

    def __len__(self) -> int:
        """Moments that there are."""
        return len(self._moments)

    def draw(self, rng: np.random.Generator) -> Moment:
        """One of the moments, more often where more was lost."""
        return self._moments[rng.choice(len(self._moments), p=self._chances)]
