"""Reading data files: those that users write, and those shipped with the package under a name."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import read_text
from nathlon.sim.validation import check_kinds, first_fault

DATA = Path(__file__).parent / "data"

Model = TypeVar("Model", bound=BaseModel)

LONGEST_KEY = 16
"""Parts with dots between."""
KEY_PART = r"""(?:[\w-]++|"(?:[^"\\\n]|\\.){0,200}+"|'[^'\n]{0,200}+')"""
LONG_KEY = re.compile(rf"(?<![\w-])(?:{KEY_PART}[ \t]*+\.[ \t]*+){{{LONGEST_KEY}}}")


def _printable(name: str) -> str:
    if not name.strip() or not name.isprintable():
        raise ValueError("expected a name of characters that can be printed, on one line")
    return name


Name = Annotated[str, Field(max_length=200), AfterValidator(_printable)]
"""What is printed in tables and reports: it must not steer a terminal."""


Named = Annotated[str, Field(min_length=1)]
"""A path or another's name; an empty one would be the current folder."""


class Section(BaseModel):
    """A table of a data file: no unknown fields, no numbers that are not finite, never changed."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def find_data(name: str, kind: str, folder: Path) -> Path:
    """The file meant by a name: one shipped in `folder`, or any that the name is the path of.

    A shipped file is `NAME.toml`, or `NAME/KIND.toml` where more files belong to it; so for paths.

    Raises:
        InputError: if nothing is shipped under the name.
    """
    if name.endswith(".toml"):
        return Path(name)
    shipped = {path.stem: path for path in folder.glob("*.toml")}
    shipped |= {path.parent.name: path for path in folder.glob(f"*/{kind}.toml")}
    if name not in shipped:
        if (own := Path(name) / f"{kind}.toml").is_file():
            return own
        known = ", ".join(sorted(shipped))
        raise InputError(
            f"{kind} {name!r} is unknown; expected one of {known}, or the path of a .toml file or its folder"
        )
    return shipped[name]


def read_toml(path: Path, model: type[Model], kind: str) -> Model:
    """Read a TOML file and check it against a model.

    Args:
        path: the file.
        model: what it must hold.
        kind: what it is, for the error: `car`.

    Raises:
        InputError: if the file cannot be read, or a field is missing, unknown or out of range.
    """
    text = read_text(path, f"{kind} file")
    # Time and memory that tomllib takes grow with the square of a key's parts: minutes for 100 kB of dots.
    if LONG_KEY.search(text):
        raise InputError(f"{path}: not a TOML file: expected keys of at most {LONGEST_KEY} parts")
    try:
        fields = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None
    except RecursionError:
        raise InputError(f"{path}: not a TOML file: expected values that are not nested so deep") from None
    except ValueError as error:  # of whole numbers with thousands of digits
        raise InputError(f"{path}: not a TOML file: {error}") from None
    return checked(fields, model, str(path))


def checked(fields: Mapping[str, Any], model: type[Model], where: str) -> Model:
    """Fields as a model.

    Args:
        fields: by name.
        model: what they must be.
        where: where they come from, for the error.

    Raises:
        InputError: if a field is missing, unknown or out of range.
    """
    try:
        made = model.model_validate(fields)
        check_kinds(fields, made)
    except ValidationError as error:
        raise InputError(f"{where}: {first_fault(error, model)}") from None
    return made
