"""Policies that plan around a checkpoint, as users call them: `mppi:CHECKPOINT?objective=EXPRESSION`."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from nathlon.policies.checkpoint import checkpoint_id
from nathlon.policies.sources import MPPI, suffix_of
from nathlon.sim.errors import InputError
from nathlon.sim.expressions import Expression, pure_number
from nathlon.sim.instruments import QUANTITIES
from nathlon.sim.names import printable

FORESEEN = {name: each for name, each in QUANTITIES.items() if not name.startswith("contacts")}
"""What objectives may be about: who is at fault for a contact, and when one begins, is not foreseen."""
SETTING = "?objective="


@dataclass(frozen=True)
class PlannedSource:
    """A checkpoint and what is to be added to its aims."""

    path: Path
    objective: Expression

    @classmethod
    def read(cls, source: str) -> PlannedSource:
        """What a source says.

        Raises:
            InputError: if it has no checkpoint, or its objective is no expression.
        """
        path, found, objective = source.removeprefix(f"{MPPI}:").partition(SETTING)
        if not found or suffix_of(path) != ".safetensors":
            raise InputError(
                f"{printable(source)}: expected {MPPI}:CHECKPOINT.safetensors{SETTING}EXPRESSION"
            )
        try:
            return cls(Path(path), pure_number(objective, FORESEEN))
        except InputError as error:
            raise InputError(f"{MPPI}:{path}: objective: {error}") from None

    @property
    def identity(self) -> str:
        """SHA-256 of checkpoint and objective together.

        Raises:
            InputError: if there is no such file.
        """
        facts = f"{checkpoint_id(self.path)}\n{self.objective.text}"
        return hashlib.sha256(facts.encode()).hexdigest()

    @property
    def absolute(self) -> str:
        """The source wherever this process stands."""
        return f"{MPPI}:{self.path.absolute()}{SETTING}{self.objective.text}"
