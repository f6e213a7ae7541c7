"""Strategists that are a user's own code: what `PATH.py:NAME` in a composite stands for."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from nathlon.policies.strategy import PACE, PitWall
from nathlon.sim.car import load_compounds
from nathlon.sim.errors import InputError
from nathlon.sim.service import Service


class StrategistError(Exception):
    """A user's strategist has raised, or answered what is no stop."""


class OwnStrategist:
    """A user's strategist, whose answers are checked.

    Attributes:
        tells_pace: whether it has a method `pace`; without one its cars drive as fast as they can.
    """

    def __init__(self, name: str, strategist: Any) -> None:
        """One that goes by a name."""
        self._name, self._strategist = name, strategist
        self.tells_pace = callable(getattr(strategist, "pace", None))

    def start(self, wall: PitWall) -> Service:
        """See `nathlon.policies.strategy.Strategist.start`.

        Raises:
            StrategistError: if it raises, or gives no service.
        """
        service = self._service(self._strategist.start, wall)
        if service is None:
            raise StrategistError(f"strategist {self._name}: start answered None, expected a Service")
        return service

    def decide(self, wall: PitWall) -> Service | None:
        """See `nathlon.policies.strategy.Strategist.decide`.

        Raises:
            StrategistError: if it raises, or gives neither a service nor None.
        """
        return self._service(self._strategist.decide, wall)

    def pace(self, wall: PitWall) -> float:
        """See `nathlon.policies.strategy.Strategist.pace`.

        Raises:
            StrategistError: if it raises, or gives no pace.
        """
        if not self.tells_pace:
            return 1.0
        answer, (least, most) = self._answer(self._strategist.pace, wall), PACE
        if not (isinstance(answer, int | float) and least <= answer <= most):
            raise StrategistError(
                f"strategist {self._name}: pace answered {answer!r:.200}, expected {least:g} to {most:g}"
            )
        return float(answer)

    def _service(self, method: Callable[[PitWall], Any], wall: PitWall) -> Service | None:
        answer = self._answer(method, wall)
        if answer is not None and not _is_service(answer):
            raise StrategistError(
                f"strategist {self._name}: {method.__name__} answered {answer!r:.200}, expected None or a "
                "Service with a known compound and 0 kg of fuel or more"
            )
        return answer

    def _answer(self, method: Callable[[PitWall], Any], wall: PitWall) -> Any:
        try:
            with redirect_stdout(sys.stderr):
                return method(wall)
        except MemoryError:
            raise
        # It is foreign code: whatever it raises, its car is out.
        except (Exception, SystemExit) as error:
            raise StrategistError(
                f"strategist {self._name}: {method.__name__} raised {type(error).__name__} ({error})"
            ) from error


def load_strategist(name: str, folder: Path, circuit: str, car: str) -> OwnStrategist:
    """What `PATH.py:NAME` makes for a circuit and car.

    Args:
        name: with a path that starts from `folder`.
        folder: of the composite.
        circuit, car: with which NAME is called.

    Raises:
        InputError: if there is no such file or NAME in it, it raises, or makes no strategist.
    """
    path, attribute = strategist_file(name, folder), name.rpartition(":")[2]
    try:
        with redirect_stdout(sys.stderr):
            made = getattr(_module(path), attribute)(circuit, car)
    except MemoryError:
        raise
    except (Exception, SystemExit) as error:
        raise InputError(
            f"{path}: {attribute} raised {type(error).__name__} ({error}), expected a strategist"
        ) from error
    for method in ("start", "decide"):
        if not callable(getattr(made, method, None)):
            raise InputError(f"{path}: {attribute} made no strategist: it has no method {method}")
    return OwnStrategist(attribute, made)


def strategist_file(name: str, folder: Path) -> Path:
    """The file of `PATH.py:NAME`.

    Raises:
        InputError: if there is none.
    """
    path = folder / name.rpartition(":")[0]
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected a strategist")
    return path


def strategist_id(name: str, folder: Path) -> str:
    """All that tells it apart: its NAME and the SHA-256 of its file. Nothing of it is run.

    Raises:
        InputError: if there is no such file.
    """
    digest = hashlib.sha256(strategist_file(name, folder).read_bytes()).hexdigest()
    return f"{name.rpartition(':')[2]} {digest}"


def _module(path: Path) -> ModuleType:
    """A file as a module, which finds none of those beside it: they would not be part of its id."""
    spec = spec_from_file_location(f"nathlon_strategist_{path.stem}", path)
    assert spec is not None, "the path ends with .py"
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def _is_service(answer: Any) -> bool:
    if not isinstance(answer, Service):
        return False
    fuel_kg = answer.fuel_kg
    numeric = fuel_kg is None or (isinstance(fuel_kg, int | float) and bool(0.0 <= fuel_kg < np.inf))
    return numeric and (answer.compound is None or answer.compound in load_compounds())
