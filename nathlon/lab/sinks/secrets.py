"""Secrets: they come from the environment, and no message says them."""

from __future__ import annotations

import os
import re

from nathlon.sim.errors import InputError
from nathlon.sim.names import printable

SECRET = re.compile(r"KEY|TOKEN|PASSWORD|SECRET|CREDENTIAL|WEBHOOK", re.IGNORECASE)
"""In the names of variables whose values are never said."""
LONGEST = 300
"""Letters of a sentence."""
SHORTEST = 6
"""Letters of such a value; a shorter one may be part of any word."""
USER = re.compile(r"//[^/@\s]+@")


def revealed(value: str) -> str:
    """A value of the configuration: `$NAME` is that variable of the environment.

    Raises:
        InputError: if it is not set.
    """
    if not value.startswith("$"):
        return value
    found = os.environ.get(value[1:])
    if not found:
        raise InputError(f"the environment variable {value[1:]} is not set")
    return found


def concealed(text: str, address: str) -> str:
    """A sentence in one line without secrets, however a library has come to quote them.

    Args:
        text: the sentence.
        address: of the sink; of one with a path, the path is a secret too.
    """
    path = address.partition("://")[2].partition("/")[2]
    variables = [value for name, value in os.environ.items() if SECRET.search(name)]
    for secret in sorted({path, *variables}, key=len, reverse=True):
        if len(secret) >= SHORTEST:
            text = text.replace(secret, "***")
    return printable(" ".join(USER.sub("//***@", text).split()))[:LONGEST]
