"""The cells of a matrix: settings, and starting places in them."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

from nathlon.arena.entrance import check_opponents, enter_each
from nathlon.arena.entrant import Entrant, only_once
from nathlon.arena.pool import Pool
from nathlon.arena.world import World
from nathlon.arena.world_registry import load_world
from nathlon.selection.config import Config
from nathlon.selection.matrix_settings import MatrixSettings
from nathlon.sim.car import load_car
from nathlon.sim.errors import InputError
from nathlon.sim.track import load_track

OURS = ("circuits", "cars", "compounds", "delays_s", "rates_hz", "blurs", "noises")
"""Settings that other worlds do not have."""


class CellPair(NamedTuple):
    """Who is looked at, and beside whom."""

    policy: Entrant
    baseline: Entrant


class CellSetting(NamedTuple):
    """What the cells of several starting places have in common.

    A compound is empty where it is the scenario's own, and so is 0 actions a second.
    """

    circuit: str
    car: str
    scenario: str
    compound: str
    delay_s: float
    hz: float = 0.0
    blur: int = 0
    noise: float = 0.0

    @property
    def raced(self) -> str:
        """The name of the scenario with its tyres, and with how its cars see."""
        changed = [f"compound={self.compound}"] if self.compound else []
        seen = {"delay": self.delay_s, "hz": self.hz, "blur": self.blur, "noise": self.noise}
        changed += [f"{name}={value:g}" for name, value in seen.items() if value]
        return self.scenario + (":" + ",".join(changed) if changed else "")

    @property
    def number(self) -> int:
        """By which its starts are drawn, whatever else is in the matrix."""
        return zlib.crc32("|".join(map(str, self)).encode())


class Cell(NamedTuple):
    """One starting place in a setting."""

    setting: CellSetting
    place: int


@dataclass(frozen=True)
class MatrixPlan:
    """What a matrix consists of.

    Attributes:
        cells: to be driven, those of a setting one after the other.
        pairs: by circuit and car, who drives there.
        set_aside: sentences on what cannot be driven.
    """

    cells: list[Cell]
    pairs: Mapping[tuple[str, str], CellPair]
    set_aside: list[str]

    def settings(self) -> dict[CellSetting, list[int]]:
        """The starting places by setting."""
        places: dict[CellSetting, list[int]] = {}
        for cell in self.cells:
            places.setdefault(cell.setting, []).append(cell.place)
        return places


def plan_cells(pool: Pool, policy: str, baseline: str, config: Config) -> MatrixPlan:
    """All cells that can be driven, and why the others cannot.

    Raises:
        InputError: if there is no cell that can, or policy and baseline are the same.
    """
    asked, ours = config.matrix, bool(config.circuit)
    set_aside: list[str] = []
    pairs: dict[tuple[str, str], CellPair] = {}
    cells: list[Cell] = []
    if not ours and set(OURS) & asked.model_fields_set:
        set_aside.append(f"{', '.join(OURS)}: world {config.world!r} has none")
    for circuit, car in _places(config):
        world = load_world(config.world, circuit, car)
        if ours:
            _check_place(circuit, car)
        pair = _entered(pool, policy, baseline, circuit, car, config.world)
        if isinstance(pair, InputError):
            set_aside.append(f"{circuit} with {car}: {pair}" if ours else str(pair))
            continue
        pairs[circuit, car] = pair
        opponents = asked.opponents or (world.baseline,)
        check_opponents(pool, opponents, pair.policy, "section matrix: field opponents")
        for setting in _settings(circuit, car, asked, ours):
            cells += _cells(world, setting, asked.places, set_aside)
    if not cells:
        raise InputError(f"nothing can be driven: {'; '.join(set_aside)}")
    return MatrixPlan(cells, pairs, set_aside)


def _places(config: Config) -> Sequence[tuple[str, str]]:
    if not config.circuit:
        return [("", "")]
    return list(product(config.matrix.circuits or (config.circuit,), config.matrix.cars or (config.car,)))


def _check_place(circuit: str, car: str) -> None:
    """Raise an InputError for a circuit or a car that is none."""
    for name, load in (("circuits", lambda: load_track(circuit)), ("cars", lambda: load_car(car))):
        try:
            load()
        except InputError as error:
            raise InputError(f"section matrix: {name}: {error}") from None


def _entered(
    pool: Pool, policy: str, baseline: str, circuit: str, car: str, world: str
) -> CellPair | InputError:
    """Who drives on a circuit with a car, or why nobody does.

    Raises:
        InputError: if the two are the same.
    """
    first, second = enter_each(pool, [policy, baseline], circuit, car, world)
    for answer in (first, second):
        if isinstance(answer, InputError):
            return answer
    both = only_once([entrant for entrant in (first, second) if isinstance(entrant, Entrant)])
    if len(both) < 2:
        raise InputError(f"{policy}: is the baseline, expected another policy")
    return CellPair(*both)


def _settings(circuit: str, car: str, asked: MatrixSettings, ours: bool) -> Iterator[CellSetting]:
    if not ours:
        asked = MatrixSettings(scenarios=asked.scenarios, delays_s=(0.0,))
    levels = product(
        asked.scenarios,
        asked.compounds or ("",),
        asked.delays_s,
        asked.rates_hz or (0.0,),
        asked.blurs,
        asked.noises,
    )
    for scenario, compound, delay_s, hz, blur, noise in levels:
        yield CellSetting(circuit, car, scenario, compound, delay_s, hz, blur, noise)


def _cells(world: World, setting: CellSetting, places: Sequence[int], set_aside: list[str]) -> list[Cell]:
    """The cells of a setting; what it has no room for is told to `set_aside`.

    Raises:
        InputError: if there is no such scenario.
    """
    setup = world.setup(setting.raced)
    try:
        world.check(setting.raced)
    except InputError as error:
        if str(error) not in set_aside:
            set_aside.append(str(error))
        return []
    cells = [Cell(setting, place) for place in places if place <= len(setup.sides)]
    if not cells:
        lack = f"scenario {setting.scenario!r} has {len(setup.sides)} places, expected one of them in places"
        if lack not in set_aside:
            set_aside.append(lack)
    return cells
