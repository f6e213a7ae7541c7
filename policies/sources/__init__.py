"""What users call policies by, checked without loading anything, so that a mistake is answered at once."""

from __future__ import annotations

import math
from importlib.metadata import entry_points
from pathlib import Path
from typing import NamedTuple

from nathlon.policies.temper import FAIR, TEMPERS
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable, settings_of

DRIVER, PLUGIN, OBJECT, HUMAN, MPPI = "driver", "plugin", "object", "human", "mppi"
"""Kinds of policies; `KIND:NAME` is the source of one. HUMAN is what a person did, `human:FILE`; MPPI plans
around a checkpoint, `mppi:FILE?objective=EXPRESSION`."""
GENERALIST = "generalist"
"""Name of the bundled checkpoint that drives any car on any circuit."""
RANDOM = "random"
"""Source of the policy of other worlds that draws its actions."""
COMPOSITE = ".toml"
"""Suffix of composites."""
ROLES = ".roles.toml"
"""What the names of files end with that name a policy for each role."""
SUFFIXES = (".safetensors", ".zip", ".onnx")
"""Of the files that hold policies; in capitals too, see `suffix_of`."""
WEIGHTS = (".pt", ".pth", ".ckpt", ".cleanrl_model")
"""Of files of weights that only the code which trained them can read; see `nathlon.arena.worlds.loaded`."""
ARCHIVE = b"PK\x03\x04"
"""How an archive begins."""
PLUGINS = "nathlon.policies"
"""Group of the entry points by which packages offer policies."""
TRAINING_STATE = ("state.safetensors", "replay.safetensors")
"""Files of a training run that are no checkpoints."""


def is_path(source: str) -> bool:
    """Whether a source is the path of a file; others go by names of their own."""
    return source.partition(":")[0] not in (DRIVER, HUMAN, MPPI, OBJECT, PLUGIN, RANDOM)


CAR_SETTING = "?car="
"""Stands between the source of an entrant and the car that it drives, in events."""


def source_and_car(given: str) -> tuple[str, str | None]:
    """What `SOURCE?car=NAME` says; no car where it names none."""
    source, found, car = given.rpartition(CAR_SETTING)
    return (source, car) if found else (given, None)


def suffix_of(source: str | Path) -> str:
    """What the name of a file ends with, in small letters: one of SUFFIXES where it may hold a policy.

    Stable-Baselines3 leaves its ending out where a name has a dot, as `model_0.5`: `.zip` of such a file too.
    """
    suffix = Path(source).suffix.lower()
    return ".zip" if suffix not in (*SUFFIXES, COMPOSITE) and _is_sb3(Path(source)) else suffix


def stem_of(source: str | Path) -> str:
    """The name of a file without its ending; digits after a dot are none."""
    path = Path(source)
    return path.name if path.suffix[1:].isdecimal() else path.stem


def _is_sb3(path: Path) -> bool:
    """Whether a file is an archive with what Stable-Baselines3 writes into one."""
    try:
        # Nothing but a regular file, for others may wait for ever.
        if not path.is_file():
            return False
        with path.open("rb") as file:
            if file.read(len(ARCHIVE)) != ARCHIVE:
                return False
        from zipfile import BadZipFile, ZipFile  # most sources are no archives

        try:
            with ZipFile(path) as archive:
                return {"data", "policy.pth"} <= set(archive.namelist())
        except (BadZipFile, ValueError, NotImplementedError):
            return False
    except OSError:
        return False


class DriverSettings(NamedTuple):
    """How a built-in driver drives.

    Attributes:
        pace: share of the speed that it could reach.
        lane: m to the left of the centre line on which it drives; None for the racing line.
        early: m before the point where it must brake at which it does.
        grip: of the road that it expects, as a multiple of that of a dry one.
        temper: how near it comes to others, a name of TEMPERS.
        rollout: s for which it tries ways past others in copies of the race; 0 for not at all.
    """

    pace: float = 1.0
    lane: float | None = None
    early: float = 0.0
    grip: float = 1.0
    temper: str = FAIR
    rollout: float = 0.0


def driver_settings(source: str) -> DriverSettings:
    """What `driver:pace=0.95,lane=2.5,early=30,temper=calm` says.

    Raises:
        InputError: if a setting is unknown, no number or out of range.
    """
    values: dict[str, float] = {}
    temper: str = FAIR
    for key, value in settings_of(source.partition(":")[2], f"driver {source!r}"):
        if key == "temper":
            temper = value
            continue
        try:
            values[key] = float(value)
        except ValueError:
            raise InputError(f"driver {source!r}: setting {key} is {value!r}, expected a number") from None
        if not math.isfinite(values[key]):
            raise InputError(f"driver {source!r}: setting {key} is {value!r}, expected a finite number")
    unknown = set(values) - set(DriverSettings._fields)
    if unknown:
        known = ", ".join(DriverSettings._fields)
        raise InputError(
            f"driver {source!r}: unknown setting {sorted(unknown)[0]!r}, expected one of {known}"
        )
    if temper not in TEMPERS:
        raise InputError(f"driver {source!r}: temper is {temper!r}, expected one of {', '.join(TEMPERS)}")
    settings = DriverSettings(**values, temper=temper)
    if not 0.2 <= settings.pace <= 1.1:
        raise InputError(f"driver {source!r}: pace is {settings.pace}, expected 0.2 to 1.1")
    if not 0.0 <= settings.early <= 200.0:
        raise InputError(f"driver {source!r}: early is {settings.early}, expected 0 to 200 m")
    if not 0.05 <= settings.grip <= 1.5:  # as of the surfaces of a scenario
        raise InputError(f"driver {source!r}: grip is {settings.grip}, expected 0.05 to 1.5")
    if settings.rollout and not 2.0 <= settings.rollout <= 20.0:
        raise InputError(f"driver {source!r}: rollout is {settings.rollout}, expected 2 to 20 s, or 0")
    if settings.rollout and (settings.lane is not None or settings.early):
        raise InputError(f"driver {source!r}: has a rollout, expected neither lane nor early beside it")
    return settings


def check_source(source: str) -> None:
    """Raise an InputError for what cannot be a policy: no such file, package or setting."""
    kind, _, name = source.partition(":")
    if kind == DRIVER:
        driver_settings(source)
    elif kind == PLUGIN:
        offered = entry_points(group=PLUGINS).names
        if name not in offered:
            known = ", ".join(sorted(offered)) or "none"
            raise InputError(f"{PLUGIN}:{name}: no package offers this policy; those offered are {known}")
    elif kind == HUMAN:
        if not Path(name).is_file():
            raise InputError(f"{printable(source)}: no such file, expected the inputs of a person")
    elif kind == MPPI:
        path = name.partition("?")[0]
        if not Path(path).is_file():
            raise InputError(f"{printable(path)}: no such file, expected a checkpoint to plan around")
    elif kind != OBJECT and source != RANDOM and not Path(source).exists():
        raise InputError(f"{printable(source)}: no such file, expected a policy")
