"""Secrets: they come from the environment and in addresses, and no message says them."""

from __future__ import annotations

import os
import re

from nathlon.sim.names import printable

VARIABLE = re.compile(r"KEY|TOKEN|PASSWORD|SECRET|CREDENTIAL|WEBHOOK", re.IGNORECASE)
"""In the names of variables whose values are never said."""
SHORTEST = 6
"""Letters of such a value; a shorter one may be part of any word."""
LONGEST = 300
"""Letters of a sentence."""
LOGIN = re.compile(r"//[^/?#\s]*@")
QUERY = re.compile(r"(://[^?\s]*)\?[^\s'\")>]*")


def shown(address: str) -> str:
    """An address as it may be said: without its login, and without its query, which may be a signature."""
    return printable(QUERY.sub(r"\1", LOGIN.sub("//***@", address)))


def secrets_of(address: str) -> set[str]:
    """The login of an address, its password, and its query; each may be ''."""
    rest = address.partition("://")[2]
    login = re.split("[/?#]", rest, maxsplit=1)[0].rpartition("@")[0]
    return {login, login.partition(":")[2], rest.partition("?")[2]}


def concealed(text: str, *more: str) -> str:
    """A sentence in one line without secrets, however a library has come to quote them.

    Args:
        text: the sentence.
        more: secrets beside those of the environment.
    """
    secrets = {*more}
    for name, value in os.environ.items():
        # A password may have what ends a login, so that only the last @ tells where it ends.
        login = value.partition("://")[2].rpartition("@")[0]
        secrets |= {login, login.partition(":")[2], value if VARIABLE.search(name) else ""}
    for secret in sorted(secrets, key=len, reverse=True):
        if len(secret) >= SHORTEST:
            text = text.replace(secret, "***")
    text = QUERY.sub(r"\1?***", LOGIN.sub("//***@", text))
    return printable(" ".join(text.split()))[:LONGEST]
