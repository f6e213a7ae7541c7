"""A clock of the machine that can be put on and back."""

from __future__ import annotations

from datetime import datetime, timedelta, tzinfo

import pytest

from nathlon.arena.store import database


class Clock:
    """What a SQLite store takes the time from.

    Attributes:
        ahead: of the true time.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.ahead = timedelta()
        clock = self

        class Shifted(datetime):
            @classmethod
            def now(cls, tz: tzinfo | None = None) -> datetime:  # type: ignore[override]
                return clock.read(tz)

        monkeypatch.setattr(database, "datetime", Shifted)

    def read(self, zone: tzinfo | None) -> datetime:
        return datetime.now(zone) + self.ahead


class Jumping(Clock):
    """One that is put back by a day or forward by a year, in turn, whenever it has been read three times."""

    reads = 0

    def read(self, zone: tzinfo | None) -> datetime:
        self.reads += 1
        if self.reads % 3 == 0:
            self.ahead += timedelta(days=-1 if self.reads % 2 else 365)
        return super().read(zone)
