"""What is wrong with a file that was checked against a model, in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError, from_json

from nathlon.sim.errors import InputError

ModelT = TypeVar("ModelT", bound=BaseModel)


def read_json(content: str | bytes, model: type[ModelT], where: object) -> ModelT:
    """JSON as a model.

    Args:
        content: the JSON.
        model: what it must be.
        where: where it comes from, for the error.

    Raises:
        InputError: if it is none, or a field is missing, unknown or out of range.
    """
    try:
        made = model.model_validate_json(content)
        check_kinds(from_json(content), made)
    except ValidationError as error:
        raise InputError(f"{where}: {first_fault(error, model)}") from None
    return made


def check_kinds(given: Any, made: Any) -> None:
    """Make sure that models have made numbers of numbers alone, and switches of true and false alone.

    They would take `true` for 1, "3" for 3 and 1 for true. Strict models take no lists for tuples either.

    Args:
        given: what was validated, of a TOML or JSON file.
        made: what came of it.

    Raises:
        ValidationError: that names the first field of another kind.
    """
    for place, value, expected in _other_kinds(given, made, ()):
        kind = PydanticCustomError("kind", "Input should be {expected}", {"expected": expected})
        details = InitErrorDetails(type=kind, loc=place, input=value)
        raise ValidationError.from_exception_data(type(made).__name__, [details])


def _other_kinds(
    given: Any, made: Any, place: tuple[int | str, ...]
) -> Iterator[tuple[tuple[int | str, ...], Any, str]]:
    if isinstance(given, Mapping):
        parts = _fields(made)
        for key in given:
            if key in parts:
                yield from _other_kinds(given[key], parts[key], (*place, key))
    elif isinstance(given, list) and isinstance(made, list | tuple):
        for index, (before, after) in enumerate(zip(given, made, strict=False)):
            yield from _other_kinds(before, after, (*place, index))
    elif isinstance(made, bool):
        if not isinstance(given, bool):
            yield place, given, "true or false"
    elif isinstance(made, int | float) and isinstance(given, bool | str):
        yield place, given, "a number"


def _fields(made: Any) -> Mapping[str, Any]:
    """The fields of what a table has become, by their names in files."""
    if isinstance(made, BaseModel):
        fields = type(made).model_fields
        return {field.alias or name: getattr(made, name) for name, field in fields.items()}
    if isinstance(made, Mapping):
        return made
    return made._asdict() if hasattr(made, "_asdict") else getattr(made, "__dict__", {})


def first_fault(error: ValidationError, model: type[BaseModel]) -> str:
    """The first fault of a validation against a model as `field is value: what was expected`."""
    fault = error.errors()[0]
    field = ".".join(str(part) for part in fault["loc"])
    message = fault["msg"].removeprefix("Value error, ")
    if not field:
        return message
    if fault["type"] == "extra_forbidden":
        return f"field {field} is unknown; expected one of {', '.join(_known([model], fault['loc'][:-1]))}"
    if fault["type"] == "missing" or isinstance(fault["input"], dict):
        return f"field {field}: {message}"
    return f"field {field} is {fault['input']!r}: {message}"


def check_distinct(**fields: Iterable[object]) -> None:
    """Make sure that in none of some fields something stands twice.

    Raises:
        ValueError: if it does; a validator of a model raises it.
    """
    for name, values in fields.items():
        for value, times in Counter(values).items():
            if times > 1:
                raise ValueError(f"{name} has {value!r} twice")


def _known(models: Sequence[type[BaseModel]], place: Sequence[int | str]) -> list[str]:
    """The fields that there may be at a place in one of some models."""
    if not place:
        return sorted({name for model in models for name in model.model_fields})
    first, *rest = place
    fields = [field for model in models for name, field in model.model_fields.items() if name == first]
    if fields:
        return _known([inner for field in fields for inner in _models(field.annotation)], rest)
    # An index, a key, or the tag of one of several models.
    tagged = [
        model
        for model in models
        if any(first in get_args(field.annotation) for field in model.model_fields.values())
    ]
    return _known(tagged or models, rest)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models in a type."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models(argument)
