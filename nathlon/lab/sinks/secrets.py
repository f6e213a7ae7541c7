"""Addresses of sinks, which are secrets: they come from the environment, and no message says them."""

from __future__ import annotations

import os
import re

from nathlon.sim import secrets
from nathlon.sim.errors import InputError


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
    """As of `nathlon.sim.secrets`, and without what follows the host in the address of the sink."""
    _, *path = re.split("[/?#]", address.partition("://")[2], maxsplit=1)
    return secrets.concealed(text, *secrets.secrets_of(address), *path)
