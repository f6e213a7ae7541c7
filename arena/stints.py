"""What cars drove between their stops, and what the stops took."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import NamedTuple


class DrivenStint(NamedTuple):
    """Laps on one set of tyres.

    Attributes:
        compound: of the tyres.
        laps: completed when the car came back from the stop that ended it, less those before.
        stood_s: in the box at that stop; None of the last stint.
        lane_s: in the pit lane at that stop, standing included; None of the last stint.
    """

    compound: str
    laps: int
    stood_s: float | None = None
    lane_s: float | None = None


def written(stints: Sequence[DrivenStint]) -> str:
    """The column `stints` of RESULTS."""
    return json.dumps([stint._asdict() for stint in stints])


def read(text: str | None) -> list[DrivenStint]:
    """The stints of a row of RESULTS; none of a car without a strategist."""
    return [] if text is None else [DrivenStint(**stint) for stint in json.loads(text)]
