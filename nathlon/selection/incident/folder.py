"""The folder of incidents: a file of the test each, with its scenario and the policies that it needs."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from nathlon.policies.sources import DRIVER, PLUGIN
from nathlon.selection.incident.freeze import Frozen
from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import whole_file, write_whole

SCENARIO = ".scenario.toml"
"""What the names of scenarios end with, so that they are not taken for tests."""


def add_incident(folder: Path, frozen: Frozen, sources: Mapping[int, str]) -> Path:
    """Write an incident into a folder, with copies of its opponents' files.

    Args:
        folder: made if it is not there.
        frozen: the incident.
        sources: of the policies that drove, by car.

    Returns:
        the path of the test.

    Raises:
        InputError: if there is a test of that name, or a policy's file is gone.
    """
    name = frozen.skill.name
    path, scenario = folder / f"{name}.toml", folder / f"{name}{SCENARIO}"
    if path.exists():
        raise InputError(f"{path}: exists already, expected a new name")
    folder.mkdir(parents=True, exist_ok=True)
    opponents = tuple(_kept(sources[car], folder) for car in frozen.others)
    skill = frozen.skill.model_copy(update={"scenario": scenario.name, "opponents": opponents})
    for file, section in ((scenario, frozen.scenario), (path, skill)):
        write_whole(file, toml(section.model_dump(mode="json", exclude_none=True)))
    return path


def incident_files(folder: Path) -> list[Path]:
    """The tests in a folder.

    Raises:
        InputError: if there is no such folder.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder, expected one with incidents")
    return sorted(path for path in folder.glob("*.toml") if not path.name.endswith(SCENARIO))


def toml(section: Mapping[str, Any]) -> str:
    """A section as TOML: values first, then tables, then tables of arrays."""
    return "\n".join(_lines(section, "")) + "\n"


def _lines(section: Mapping[str, Any], prefix: str) -> list[str]:
    plain = {key: value for key, value in section.items() if not _is_table(value)}
    lines = [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in plain.items()]
    for key, value in section.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{prefix}{key}]", *_lines(value, f"{prefix}{key}.")]
    for key, value in section.items():
        if _is_table(value) and not isinstance(value, Mapping):
            for one in value:
                lines += ["", f"[[{prefix}{key}]]", *_lines(one, f"{prefix}{key}.")]
    return lines


def _is_table(value: Any) -> bool:
    return isinstance(value, Mapping) or (
        isinstance(value, list) and bool(value) and isinstance(value[0], Mapping)
    )


def _kept(source: str, folder: Path) -> str:
    """How a test in the folder names a policy; that of a file is copied beside it."""
    if source.partition(":")[0] in (DRIVER, PLUGIN):
        return source
    file = Path(source)
    if not file.is_file():
        raise InputError(f"{source}: no such file, expected the policy that drove")
    kept = folder / file.name
    if not kept.exists():
        with whole_file(kept) as partial:
            shutil.copyfile(file, partial)
    elif kept.read_bytes() != file.read_bytes():
        raise InputError(
            f"{kept}: is another policy than {file}, expected a folder of its own for one of them"
        )
    return file.name
