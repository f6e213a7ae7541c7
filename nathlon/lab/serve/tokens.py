"""The tokens by which the room knows its members."""

from __future__ import annotations

import secrets
from collections.abc import Iterable


class Tokens:
    """A token for each member, drawn anew, and a pass by which their browsers get files.

    The token lets its member speak. The pass is a cookie, so it only lets them read.

    Attributes:
        by_member: tokens, by the names of members.
    """

    def __init__(self, members: Iterable[str]) -> None:
        self.by_member = {member: secrets.token_urlsafe(32) for member in members}
        self._passes = {member: secrets.token_urlsafe(32) for member in self.by_member}

    def member(self, token: str) -> str | None:
        """Whose token it is; None for one that nobody has."""
        return _whose(self.by_member, token)

    def pass_of(self, member: str) -> str:
        """The pass of a member."""
        return self._passes[member]

    def reader(self, given: str) -> str | None:
        """Whose pass it is; None for one that nobody has."""
        return _whose(self._passes, given)


def _whose(secrets_of: dict[str, str], given: str) -> str | None:
    # All are compared, in the same time: how long it takes tells nothing.
    found = [
        member
        for member, secret in secrets_of.items()
        if secrets.compare_digest(given.encode(), secret.encode())
    ]
    return found[0] if found else None
