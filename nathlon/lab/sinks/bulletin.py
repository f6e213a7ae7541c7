"""What a sink is told: of a night, or of a gate."""

from __future__ import annotations

import hashlib
from pathlib import Path

from nathlon.results.part import ResultModel
from nathlon.results.standing import Ranked
from nathlon.results.summary import Sent

PICTURE = "report/ranking.png"
"""The ranking as a picture, in the folder of the night."""


def place(circuit: str, car: str, world: str) -> str:
    """What is driven: `lindenring-gt3`, or another world."""
    return f"{circuit}-{car}" if circuit else world


class Bulletin(ResultModel):
    """A night in words and numbers; a webhook gets all but `folder`.

    Attributes:
        night: its name; None where all that was new was set aside.
        code, reason: as the command exits and says.
        headline, sentences: the verdict.
        circuit, car: what was driven; empty in another world.
        world: simulator in which everything was played.
        sent: who is sent.
        ranking: best first.
        report, picture: addresses; None where the configuration has no link.
        folder: of the night on this machine; None where there is none.
    """

    night: str | None
    code: int
    reason: str
    headline: str
    sentences: tuple[str, ...] = ()
    circuit: str = ""
    car: str = ""
    world: str = ""
    sent: tuple[Sent, ...] = ()
    ranking: tuple[Ranked, ...] = ()
    report: str | None = None
    picture: str | None = None
    folder: Path | None = None

    @property
    def key(self) -> str:
        """A name for the night that no night of another folder has."""
        return f"{self.night}-{hashlib.sha256(str(self.folder).encode()).hexdigest()[:8]}"

    @property
    def place(self) -> str:
        """What was driven, for names."""
        return place(self.circuit, self.car, self.world)


class Promotion(ResultModel):
    """Whom a gate has passed.

    Attributes:
        place: what it drives: `lindenring-gt3`, or a world.
        entrant: its id.
        name: its name.
        source: its file.
    """

    place: str
    entrant: str
    name: str
    source: Path
