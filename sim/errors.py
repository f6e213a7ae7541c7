"""The error that a user's own input can cause."""

from pydantic import ValidationError


class InputError(Exception):
    """Bad input: one sentence naming the file, the field and what was expected.

    The command line prints it as it is and exits with code 2.
    """


def first_fault(error: ValidationError) -> str:
    """The first fault of a validation as `field is value: what was expected`."""
    fault = error.errors()[0]
    field = ".".join(str(part) for part in fault["loc"])
    message = fault["msg"].removeprefix("Value error, ")
    if not field:
        return message
    if fault["type"] in ("missing", "extra_forbidden") or isinstance(fault["input"], dict):
        return f"field {field}: {message}"
    return f"field {field} is {fault['input']!r}: {message}"
