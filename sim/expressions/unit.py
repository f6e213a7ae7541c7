"""Units as powers of base units: what tells metres from metres a second."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction

from nathlon.sim.errors import InputError

FACTOR = re.compile(r"(?P<word>[A-Za-z_]\w*)(\^(?P<power>-?\d))?|1")


@dataclass(frozen=True)
class Unit:
    """A product of powers of base units; none at all is that of a pure number.

    Radians are pure numbers, as in the SI.

    Attributes:
        powers: of the bases, ordered by their names; none is 0.
    """

    powers: tuple[tuple[str, Fraction], ...] = ()

    @classmethod
    def of(cls, **powers: int | Fraction) -> Unit:
        """The unit with these powers of bases."""
        return cls(tuple(sorted((base, Fraction(power)) for base, power in powers.items() if power)))

    @classmethod
    def parse(cls, text: str) -> Unit:
        """The unit that a text such as `m/s^2`, `1/m` or `points` says.

        Raises:
            InputError: if it is none.
        """
        unit = cls()
        above, *below = text.split("/")
        for part, sign in [(above, 1), *((part, -1) for part in below)]:
            for factor in part.split():
                match = FACTOR.fullmatch(factor)
                if match is None:
                    raise InputError(f"unit {text!r}: expected one like m/s^2, or 1 for a pure number")
                word = match["word"]
                if word is not None and word != "rad":
                    unit *= cls.of(**{word: sign * int(match["power"] or 1)})
        return unit

    def __mul__(self, other: Unit) -> Unit:
        """Of a product."""
        powers = dict(self.powers)
        for base, power in other.powers:
            powers[base] = powers.get(base, Fraction(0)) + power
        return Unit.of(**powers)

    def __truediv__(self, other: Unit) -> Unit:
        """Of a quotient."""
        return self * other**-1

    def __pow__(self, power: int | Fraction) -> Unit:
        """Of a power."""
        return Unit.of(**{base: own * power for base, own in self.powers})

    def __str__(self) -> str:
        """As people write it: `kg m/s^2`."""
        above, below = (
            " ".join(
                base if sign * power == 1 else f"{base}^{sign * power}"
                for base, power in self.powers
                if sign * power > 0
            )
            for sign in (1, -1)
        )
        if not below:
            return above or "a pure number"
        return f"{above or '1'}/" + below.replace(" ", "/")


NUMBER = Unit()
"""Of a pure number."""

CONSTANTS: dict[str, tuple[float, Unit]] = {
    "m": (1.0, Unit.of(m=1)),
    "km": (1000.0, Unit.of(m=1)),
    "s": (1.0, Unit.of(s=1)),
    "h": (3600.0, Unit.of(s=1)),
    "kg": (1.0, Unit.of(kg=1)),
    "N": (1.0, Unit.of(kg=1, m=1, s=-2)),
    "rad": (1.0, NUMBER),
    "deg": (math.radians(1.0), NUMBER),
}
"""What the names of units stand for in an expression: how many SI units, and which."""
