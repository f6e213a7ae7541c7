"""An entrant that has a policy for each role, and plays as one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gymnasium.spaces import Space

from nathlon.policies.sources.roles import RolesSource
from nathlon.sim.errors import InputError

Spaces = tuple[Space[Any], Space[Any]]
"""Of observations and of actions."""


@dataclass(frozen=True)
class RolePolicies:
    """Policies of one entrant, one for each role.

    Attributes:
        source: path of the file that names them.
        id: SHA-256 of roles and policies.
        by_role: the policies.
    """

    source: str
    id: str
    by_role: Mapping[str, Any]

    @classmethod
    def load(
        cls,
        source: str,
        seats: Mapping[str, tuple[Spaces, ...]],
        load: Callable[[str, Sequence[Spaces]], Any],
    ) -> RolePolicies:
        """The policies that a file of roles names.

        Args:
            source: path of the file.
            seats: by role, spaces of all its seats.
            load: opens the policy of a source for seats of some spaces.

        Raises:
            InputError: if the file is wrong or has other roles, or a policy cannot be loaded or does not fit.
        """
        file = RolesSource.read(Path(source))
        for role in sorted(seats.keys() ^ file.sources.keys()):
            said = "is missing" if role in seats else "is unknown"
            raise InputError(f"{source}: role {role!r} {said}, expected {', '.join(sorted(seats)) or 'none'}")
        by_role: dict[str, Any] = {}
        for role, named in file.sources.items():
            try:
                by_role[role] = load(named, seats[role])
            except InputError as error:
                raise InputError(f"{source}: role {role!r}: {error}") from None
        return cls(source, file.identity([policy.id for policy in by_role.values()]), by_role)

    @property
    def algorithm(self) -> str | None:
        """What trained them, each once; None if none is known."""
        known = dict.fromkeys(policy.algorithm for policy in self.by_role.values() if policy.algorithm)
        return ", ".join(known) or None

    @property
    def step(self) -> int | None:
        """Gradient updates of their training, if those are the same for all."""
        return _shared([policy.step for policy in self.by_role.values()])

    @property
    def seed(self) -> int | None:
        """Of their training, if it is the same for all."""
        return _shared([policy.seed for policy in self.by_role.values()])


def _shared(values: list[int | None]) -> int | None:
    return values[0] if len(set(values)) == 1 else None
