"""Policies by role: a TOML file that names who takes each of the roles that one entrant has."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from nathlon.policies.sources import COMPOSITE, MPPI, PLUGIN, RANDOM
from nathlon.sim.data_file import Name, Section, read_toml
from nathlon.sim.errors import InputError


class RolesFile(Section):
    """The TOML file: by role the path of a file of weights from its folder, `plugin:NAME` or `random`."""

    roles: Annotated[
        dict[Name, Annotated[str, Field(min_length=1, max_length=1024, pattern=r"^[^\x00]+$")]],
        Field(min_length=1, max_length=64),
    ]


@dataclass(frozen=True)
class RolesSource:
    """What a file says of roles, without the policies.

    Attributes:
        path: of the file.
        sources: names of the policies by role, files by their paths; in the order of the roles' names.
    """

    path: Path
    sources: dict[str, str]

    @classmethod
    def read(cls, path: Path) -> RolesSource:
        """Read a file of roles.

        Raises:
            InputError: if it is none, or names one of its own kind, a composite or a planner.
        """
        named = read_toml(path, RolesFile, "roles").roles
        for role, policy in named.items():
            if policy.endswith(COMPOSITE) or policy.startswith(f"{MPPI}:"):
                raise InputError(
                    f"{path}: role {role!r} is {policy!r}, expected a file of weights, a plugin or {RANDOM}"
                )
        return cls(path, {role: cls._source(path, named[role]) for role in sorted(named)})

    @staticmethod
    def _source(path: Path, policy: str) -> str:
        return policy if policy == RANDOM or policy.startswith(f"{PLUGIN}:") else str(path.parent / policy)

    def identity(self, ids: Sequence[str]) -> str:
        """SHA-256 in hexadecimal of all that decides how it plays, given the ids of its policies."""
        lines = [line for pair in zip(self.sources, ids, strict=True) for line in pair]
        return hashlib.sha256("\n".join(["roles", *lines]).encode()).hexdigest()
