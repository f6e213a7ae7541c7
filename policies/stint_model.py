"""What a lap takes one policy in one car on one circuit: a stint model, as a composite carries it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from nathlon.sim.car import compound_ratio, load_compounds
from nathlon.sim.data_file import Section
from nathlon.sim.rules import PitParameters
from nathlon.sim.scenario import MOST_LAPS
from nathlon.sim.weather import wet_share

Floats = NDArray[np.float64]
Numbers = Annotated[
    tuple[Annotated[float, Field(ge=-1e4, le=1e5)], ...], Field(min_length=1, max_length=MOST_LAPS)
]


GRIP_POWER = 0.8
"""A lap takes longer by this power of the share of grip that is left, as the built-in driver's do."""
WEAR_POWER = 2.0
"""Of its grip, by which a compound that grips less wears less: it slides with less force, and slower."""


class CompoundLaps(Section):
    """Laps on one compound, the first number of each list for new tyres, the next for those a lap old.

    Attributes:
        name: of the compound.
        lap_s: what a lap takes with an empty tank.
        used_kg: fuel that it takes.
        wear: of the tyres at its end, mean of the four; 1 is worn out.
    """

    name: str
    lap_s: Numbers
    used_kg: Numbers
    wear: Numbers

    @field_validator("name")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in load_compounds():
            raise ValueError(f"expected one of {', '.join(load_compounds())}")
        return name

    @model_validator(mode="after")
    def _alike(self) -> CompoundLaps:
        if not len(self.lap_s) == len(self.used_kg) == len(self.wear):
            raise ValueError("lap_s, used_kg and wear must be equally long")
        if (np.diff(self.wear, prepend=0.0) < 0.0).any():
            raise ValueError("wear must not fall from lap to lap")
        return self

    def age(self, wear: float) -> float:
        """Laps that tyres with some mean wear have driven, as practised; no more than were."""
        return float(np.interp(wear, [0.0, *self.wear], np.arange(len(self.wear) + 1.0)))

    def laps(self, age: float, count: int) -> tuple[Floats, Floats]:
        """What the next laps take on tyres of an age, (count,) s with an empty tank and (count,) kg.

        Beyond what was practised tyres get slower as in the last lap that was.
        """
        ages, known = age + np.arange(count), np.arange(len(self.lap_s))
        slope = max(self.lap_s[-1] - self.lap_s[-2], 0.0) if len(self.lap_s) > 1 else 0.0
        taken = np.interp(ages, known, self.lap_s) + slope * np.maximum(ages - known[-1], 0.0)
        return taken, np.interp(ages, known, self.used_kg)


class StintModel(Section):
    """What the laps and stops of a race take; `nathlon stints` fits it to practice.

    Attributes:
        fuel_s_kg: what each kilogram in the tank costs, s a lap.
        start_s: what the start costs.
        stop_s: what a stop costs beside its service.
        compound: laps on each; those are fitted that are named.
    """

    fuel_s_kg: Annotated[float, Field(ge=-10, le=10)]
    start_s: Annotated[float, Field(ge=-1e3, le=1e3)] = 0.0
    stop_s: Annotated[float, Field(ge=-1e3, le=1e4)]
    compound: Annotated[tuple[CompoundLaps, ...], Field(min_length=1, max_length=16)]

    @model_validator(mode="after")
    def _distinct(self) -> StintModel:
        names = [compound.name for compound in self.compound]
        if len(set(names)) < len(names):
            raise ValueError("a compound comes twice, expected each once")
        return self


def in_water(compounds: Sequence[str], film_mm: Floats | float) -> Floats:
    """By how many times longer laps take on compounds in water, (..., compounds), as many as are depths."""
    displaced = np.array([load_compounds()[name].film_mm for name in compounds])
    return wet_share(np.asarray(film_mm)[..., None], displaced) ** -GRIP_POWER


def with_treads(model: StintModel) -> StintModel:
    """A model with the compounds for wet roads too.

    Those that were not practised are reckoned, as on dry road, from the one that was longest: by what they
    grip and how fast they wear.
    """
    known, named = load_compounds(), [one.name for one in model.compound]
    longest = max(model.compound, key=lambda one: len(one.lap_s))
    added = [_reckoned(longest, name) for name, one in known.items() if one.treaded and name not in named]
    return model.model_copy(update={"compound": (*model.compound, *added)})


def _reckoned(practised: CompoundLaps, name: str) -> CompoundLaps:
    """Laps on another compound than that which was practised."""
    grip, faster = compound_ratio(practised.name, name)
    wear = faster * grip**WEAR_POWER
    laps = [practised.laps(age, 1) for age in wear * np.arange(len(practised.lap_s))]
    return CompoundLaps(
        name=name,
        lap_s=tuple(float(lap_s[0]) * grip**-GRIP_POWER for lap_s, _ in laps),
        used_kg=tuple(float(used_kg[0]) for _, used_kg in laps),
        wear=tuple(wear * worn for worn in practised.wear),
    )


def service_s(pit: PitParameters, tyres: bool, added_kg: Floats) -> Floats:
    """How long a car stands for new tyres or fuel or both, s; of any shape, as the fuel is."""
    fitting, filling = (pit.tyres if tyres else 0.0), added_kg / pit.fuel_rate
    return np.maximum(fitting, filling) if pit.together else fitting + filling
