"""The judge that is a person: a page on this machine alone, in which two clips play beside each other."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from copy import deepcopy
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from nathlon.arena.recorder import outline, stretches
from nathlon.lab.reward.alignment import Preference
from nathlon.lab.reward.clips import OTHERS, Studio
from nathlon.lab.reward.judging import LONGEST_REMARK, ClipPair, ClipQuestion
from nathlon.lab.web.connection import TOO_MUCH, Connection, Rate
from nathlon.lab.web.one_page import OnePage
from nathlon.reports.player import player_style
from nathlon.reports.race_data import circuit_data
from nathlon.reports.self_contained import render_page, script_data, template_text
from nathlon.sim.names import printable
from nathlon.sim.track import load_track
from nathlon.terminal import warn

LARGEST_MESSAGE = 1 << 13
MOST_MESSAGES = 20
"""That the page may send in a second."""
OWN = len(OTHERS)
"""Index of the car in question."""


class Said(BaseModel):
    """What the page says of a pair.

    Attributes:
        pair: its index.
        better: 1 if what it calls A is better, -1 if B, 0 if neither.
        remark: in words.
    """

    model_config = ConfigDict(extra="forbid", strict=True)

    pair: int = Field(ge=0)
    better: Literal[-1, 0, 1]
    remark: str = Field(default="", max_length=LONGEST_REMARK)


class Enough(BaseModel):
    """The page's last word: what is not judged remains so."""

    model_config = ConfigDict(extra="forbid", strict=True)

    enough: Literal[True]


class People:
    """Asks whoever opens the page.

    Args:
        studio: where the clips were made.
        port: to listen on, 0 for any that is free.
        on_open: told the page's address.
    """

    def __init__(self, studio: Studio, port: int = 0, on_open: Callable[[str], None] | None = None) -> None:
        self._studio, self._port = studio, port
        self._on_open = on_open or (
            lambda url: warn(f"Compare the clips at {url}  Ctrl-C stops, and all is kept.")
        )

    def judge(self, question: ClipQuestion, on_preference: Callable[[Preference], None]) -> None:
        """Serve the page until all pairs are judged, or somebody has had enough.

        Raises:
            InputError: if the port cannot be had.
        """
        asyncio.run(self._serve(question, on_preference))

    async def _serve(self, question: ClipQuestion, on_preference: Callable[[Preference], None]) -> None:
        session = PairSession(self._studio, question, on_preference)
        async with session.open_at(self._port):
            self._on_open(session.url)
            await session.over.wait()


class PairSession(OnePage):
    """Serves the page of some pairs, each of which is judged once.

    Attributes:
        over: set when all are, or somebody has had enough.
    """

    def __init__(
        self, studio: Studio, question: ClipQuestion, on_preference: Callable[[Preference], None]
    ) -> None:
        """For the arguments see `People`."""
        super().__init__(
            lambda address, token: pairs_page(studio, question, f"{address.socket}/pairs", token),
            self._listen,
            LARGEST_MESSAGE,
        )
        self.over = asyncio.Event()
        self._question, self._on_preference = question, on_preference
        self._left = set(range(len(question.pairs)))
        self._rate = Rate(MOST_MESSAGES)

    async def _listen(self, connection: Connection) -> None:
        """Say what is left, at first and after everything that the page says."""
        await connection.send(json.dumps({"left": sorted(self._left)}))
        async for message in connection:
            if self._rate.exceeded() or not self._hear(message):
                await connection.close(TOO_MUCH, "no message of this page, or too many")
                return
            await connection.send(json.dumps({"left": sorted(self._left)}))

    def _hear(self, message: str | bytes) -> bool:
        """Note what the page says; whether it is something that it may."""
        try:
            Enough.model_validate_json(message)
        except ValidationError:
            pass
        else:
            self.over.set()
            return True
        try:
            said = Said.model_validate_json(message)
        except ValidationError:
            return False
        if said.pair in self._left:
            self._left.discard(said.pair)
            pair = self._question.pairs[said.pair]
            remark = printable(" ".join(said.remark.split()))
            self._on_preference(Preference(**pair._asdict(), better=said.better, remark=remark))
        if not self._left:
            self.over.set()
        return True


def pairs_page(studio: Studio, question: ClipQuestion, socket: str, token: str) -> str:
    """The page: drivers are A and B in it, whoever they are.

    Args:
        studio: where the clips were made.
        question: what is asked.
        socket: address of its WebSocket.
        token: by which the server knows its own page.
    """
    track = load_track(studio.circuit)
    data = {
        "circuit": circuit_data(outline(track), stretches(track)),
        "pairs": [_shown(question, pair) for pair in question.pairs],
        "car": OWN,
        "socket": socket,
        "token": token,
    }
    return render_page(
        "reward/pairs.html",
        player_style() + template_text("scroll.css", "reward/page.css", "reward/pairs.css"),
        "reward/pairs.js",
        connect=socket.rpartition("/")[0],
        task=question.task,
        longest=LONGEST_REMARK,
        data=script_data(data),
    )


def _shown(question: ClipQuestion, pair: ClipPair) -> list[dict[str, Any]]:
    """Both races of a pair, without a name by which a driver could be known."""
    races = []
    for letter, name in zip("AB", (pair.first, pair.second), strict=True):
        race = deepcopy(question.clips[name].drawn[pair.start])
        for number, car in enumerate(race["cars"]):
            car["name"] = letter if number == OWN else f"car {number + 1}"
        for incident in race["incidents"]:
            incident["text"] = incident["kind"].replace("_", " ")
        race["match"] = ""
        races.append(race)
    return races
