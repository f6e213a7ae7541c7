"""An empty argument, which a shell makes of a variable that is not set, is refused by every command."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

import nathlon
from nathlon.cli import app
from nathlon.commands.groups import NAMES
from nathlon.commands.incident import named_policy
from nathlon.judge.recipes.grouping import recipe_folders
from nathlon.selection.config import read_config
from nathlon.sim.errors import InputError


def groups_and_commands(group: Any) -> Iterator[Any]:
    yield group
    for each in getattr(group, "commands", {}).values():
        yield from groups_and_commands(each)


TAKING = [
    pytest.param(command, parameter, id=f"{command.name}-{parameter.name}")
    for command in groups_and_commands(typer.main.get_command(app))
    for parameter in command.params
    if not getattr(parameter, "is_flag", False)
]


@pytest.mark.parametrize(("command", "parameter"), TAKING)
def test_every_argument(command: Any, parameter: Any) -> None:
    if parameter.param_type_name == "option":
        given = [parameter.opts[0], ""]
    else:
        arguments = [one for one in command.params if one.param_type_name == "argument"]
        given = ["x"] * arguments.index(parameter) + [""]
    if parameter.metavar == NAMES:
        given += ["--member", "ann", "--reason", "none is fit"]
        assert command.make_context(command.name, given).params[parameter.name] == ""
        return
    with pytest.raises(InputError, match=f"^{parameter.opts[0]}: is empty, expected a value"):
        command.make_context(command.name, given)


def test_what_is_half_empty() -> None:
    with pytest.raises(InputError, match="expected NAME=FILE"):
        named_policy("ann=", "--policy")
    with pytest.raises(InputError, match="names no folder"):
        recipe_folders(["base="])
    with pytest.raises(InputError, match="names no policy"):
        nathlon.select([""])


@pytest.mark.parametrize("field", ["checkpoints = ['']", "store = ''", "out = ''", "matrix.opponents = ['']"])
def test_a_configuration(field: str, tmp_path: Path) -> None:
    path = tmp_path / "nathlon.toml"
    path.write_text(field)
    with pytest.raises(InputError, match=f"field {field.split()[0]}"):
        read_config(path)
