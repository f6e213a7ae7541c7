"""Policies that installed packages offer under the entry point group `nathlon.policies`.

An entry point names a callable that takes the names of circuit and car and returns a policy, such as the
policy's class. Unlike a file of weights it is code, and is loaded only when a user names it.
"""

from __future__ import annotations

import hashlib
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from nathlon.policies.policy import Policy
from nathlon.policies.sources import PLUGIN, PLUGINS
from nathlon.sim.errors import InputError
from nathlon.sim.observation import ObservationSpec

MOVED = ("sim", "policies", "arena", "tournament", "reports")
"""Packages of nathlon that had a name of their own once."""


def load_plugin(name: str, circuit: str, car: str) -> Policy:
    """The policy that a package offers as `name`, made for a circuit and car.

    Raises:
        InputError: if no package or more than one offers it, or it is no policy.
    """
    policy = make_plugin(name, circuit, car)
    if not isinstance(getattr(policy, "observation_spec", None), ObservationSpec):
        raise _no_policy(name, "observation_spec")
    check_methods(name, policy)
    return policy


def make_plugin(name: str, *arguments: Any) -> Any:
    """What the entry point `name` makes of some arguments.

    Raises:
        InputError: if no package or more than one offers it, or it raises.
    """
    point = _entry_point(name)
    try:
        return point.load()(*arguments)
    except MemoryError:
        raise
    except ModuleNotFoundError as error:
        room = str(error.name).partition(".")[0]
        reason = f"imports {room}, expected nathlon.{room}" if room in MOVED else _raised(error)
        raise InputError(f"{PLUGIN}:{name}: {point.value} {reason}") from error
    # It is foreign code: whatever it raises, the user wants to know whose it is.
    except Exception as error:
        raise InputError(f"{PLUGIN}:{name}: {point.value} {_raised(error)}") from error


def check_methods(name: str, policy: Any) -> None:
    """Raise an InputError if what the entry point `name` made cannot act."""
    for method in ("initial_memory", "act"):
        if not callable(getattr(policy, method, None)):
            raise _no_policy(name, f"method {method}")


def plugin_id(name: str) -> str:
    """SHA-256 in hexadecimal of the entry point and of all files of the top package that it lies in.

    Nothing of the package is run.

    Raises:
        InputError: if no package or more than one offers it, or its module is not there.
    """
    point = _entry_point(name)
    digest = hashlib.sha256(f"{name}={point.value}".encode())
    top = point.module.partition(".")[0]
    spec = find_spec(top)
    if spec is None:
        raise InputError(f"{PLUGIN}:{name}: offered as {point.value}, but there is no module {top!r}")
    folders = [Path(folder) for folder in spec.submodule_search_locations or []]
    files = [(path, path.relative_to(folder)) for folder in folders for path in folder.rglob("*")]
    if not folders:
        file = Path(str(spec.origin))
        files = [(file, Path(file.name))]
    for path, relative in sorted(files):
        if path.is_file() and "__pycache__" not in relative.parts:
            content = path.read_bytes()
            digest.update(f"\0{relative.as_posix()}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


def _no_policy(name: str, missing: str) -> InputError:
    return InputError(f"{PLUGIN}:{name}: {_entry_point(name).value} made no policy: it has no {missing}")


def _raised(error: Exception) -> str:
    return f"raised {type(error).__name__} ({error}), expected a policy"


def _entry_point(name: str) -> EntryPoint:
    offered = entry_points(group=PLUGINS)
    points = list(dict.fromkeys(offered.select(name=name)))
    if not points:
        known = ", ".join(sorted(offered.names)) or "none"
        raise InputError(f"{PLUGIN}:{name}: no package offers this policy; those offered are {known}")
    if len(points) > 1:
        values = ", ".join(point.value for point in points)
        raise InputError(f"{PLUGIN}:{name}: offered more than once, by {values}")
    return points[0]
