"""Classes: cars of several models in one race, each of which has places of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from nathlon.arena.entrant import Entrant
from nathlon.arena.single_race import in_turn
from nathlon.sim.car import Car, load_car
from nathlon.sim.car_check import power_w


def class_names(cars: Sequence[str]) -> dict[str, str]:
    """What the classes of some cars are called, by the cars: after their files, where that is unique."""
    once = list(dict.fromkeys(cars))
    stems = [Path(car).stem for car in once]
    return {car: stem if stems.count(stem) == 1 else car for car, stem in zip(once, stems, strict=True)}


def grid_by_class(entrants: Sequence[Entrant], cars: int) -> list[int]:
    """A grid that entrants fill in turn, with the fastest class in front, as indices from pole.

    The fastest is that with the most power for its weight.
    """
    return sorted(in_turn(len(entrants), cars), key=lambda index: -_pace(load_car(entrants[index].car)))


def _pace(car: Car) -> float:
    return power_w(car) / car.body.mass_kg
