"""Reading data files: those that users write, and those shipped with the package under a name."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from sim.errors import InputError, first_fault

DATA = Path(__file__).parent / "data"

Model = TypeVar("Model", bound=BaseModel)


class Section(BaseModel):
    """A table of a data file: no unknown fields, no numbers that are not finite, never changed."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def find_data(name: str, kind: str, folder: Path) -> Path:
    """The file meant by a name: one shipped in `folder`, or any if the name is the path of a `.toml` file.

    A shipped file is `NAME.toml`, or `NAME/KIND.toml` where more files belong to it.

    Raises:
        InputError: if nothing is shipped under the name.
    """
    if name.endswith(".toml"):
        return Path(name)
    shipped = {path.stem: path for path in folder.glob("*.toml")}
    shipped |= {path.parent.name: path for path in folder.glob(f"*/{kind}.toml")}
    if name not in shipped:
        known = ", ".join(sorted(shipped))
        raise InputError(f"{kind} {name!r} is unknown; expected one of {known}, or the path of a .toml file")
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
    try:
        return model.model_validate(tomllib.loads(path.read_text("utf-8")))
    except OSError as error:
        raise InputError(f"{path}: cannot read the {kind} file: {error.strerror}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error, model)}") from None
