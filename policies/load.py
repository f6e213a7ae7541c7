"""Policies by name: checkpoint files and built-in drivers."""

from __future__ import annotations

from pathlib import Path

from policies.checkpoint import load_checkpoint
from policies.driver import Driver
from policies.policy import Policy
from sim.errors import InputError

DRIVER = "driver"


def load_policy(name: str, circuit: str, car: str) -> Policy:
    """The policy called `name`, made for a circuit and car.

    Args:
        name: path of a checkpoint, or `driver` with settings: `driver:pace=0.95,lane=2.5`.
        circuit: the circuit to drive.
        car: the car to drive.

    Raises:
        InputError: if there is no such policy or it cannot be read.
    """
    kind, _, settings = name.partition(":")
    if kind == DRIVER:
        return _driver(name, settings, circuit, car)
    return load_checkpoint(Path(name))


def _driver(name: str, settings: str, circuit: str, car: str) -> Driver:
    values: dict[str, float] = {}
    for setting in filter(None, settings.split(",")):
        key, _, value = setting.partition("=")
        try:
            values[key] = float(value)
        except ValueError:
            raise InputError(f"driver {name!r}: setting {key} is {value!r}, expected a number") from None
    unknown = set(values) - {"pace", "lane"}
    if unknown:
        raise InputError(f"driver {name!r}: unknown setting {sorted(unknown)[0]!r}, expected pace or lane")
    pace = values.get("pace", 1.0)
    if not 0.2 <= pace <= 1.1:
        raise InputError(f"driver {name!r}: pace is {pace}, expected 0.2 to 1.1")
    return Driver(circuit, car, pace, values.get("lane"))
