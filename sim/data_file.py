"""Reading data files that users write."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from sim.errors import InputError, first_fault

Model = TypeVar("Model", bound=BaseModel)


def read_toml(path: Path, model: type[Model], kind: str) -> Model:
    """Read a TOML file and check it against a model.

    Args:
        path: the file.
        model: what it must hold.
        kind: what it is, for the error: `car file`.

    Raises:
        InputError: if the file cannot be read, or a field is missing, unknown or out of range.
    """
    try:
        return model.model_validate(tomllib.loads(path.read_text("utf-8")))
    except OSError as error:
        raise InputError(f"{path}: cannot read the {kind}: {error.strerror}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error)}") from None
