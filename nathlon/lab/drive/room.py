"""The room in which one person drives: what the page asks for, and what it is told."""

from __future__ import annotations

import asyncio
import json
import logging
import math
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from nathlon.arena.race_log import Incident, numbered
from nathlon.lab.drive.aids import Aids
from nathlon.lab.drive.blind import BlindTest
from nathlon.lab.drive.choice import MOST_LAPS, Choice, DrivePlan, Offer, check_place, plan
from nathlon.lab.drive.clock import Clock
from nathlon.lab.drive.difficulty import CHOSEN, LEVELS, field
from nathlon.lab.drive.heat import COUNTDOWN_S, DrivenHeat, Heat
from nathlon.lab.drive.input_buffer import InputBuffer
from nathlon.lab.drive.keeping import Kept, keep, nearest
from nathlon.lab.drive.mark import Mark
from nathlon.lab.drive.scenery import scenery
from nathlon.reports.race_data import race_data
from nathlon.selection.publish.output import OutputFolder
from nathlon.sim.errors import InputError
from nathlon.sim.scenario_start import MOST_CARS

log = logging.getLogger(__name__)

Words = dict[str, Any]
"""A message to or from the page."""
PAUSED: Words = {"type": "paused"}
COLOURS = ("#f2b134", "#6fb7ff", "#f06a6a", "#79d28a", "#c99cf0", "#f0956a", "#6fe0e0", "#f08ac0", "#cfd466")
"""Of the person's car, and of the others by who drives them."""


class Mailbox:
    """What waits to be sent to the page: every message, and of the frames the latest."""

    def __init__(self) -> None:
        self._words: deque[str] = deque()
        self._frame: bytes | None = None
        self._filled = asyncio.Event()

    def say(self, words: Words) -> None:
        """Have a message sent."""
        self._words.append(json.dumps(_plain(words)))
        self._filled.set()

    def show(self, frame: bytes) -> None:
        """Have a frame sent, unless a later one comes before it can be."""
        self._frame = frame
        self._filled.set()

    async def take(self) -> str | bytes:
        """What is to be sent next, once there is something."""
        await self._filled.wait()
        if self._words:
            taken: str | bytes = self._words.popleft()
        else:
            assert self._frame is not None, "it was filled"
            taken, self._frame = self._frame, None
        if not self._words and self._frame is None:
            self._filled.clear()
        return taken


class Room:
    """One person's drives, one after another. All methods belong to the event loop.

    Attributes:
        buffer: where inputs arrive.
        heat: the present race; None before the first, and between them.
        kept: what was kept, in turn.

    Args:
        offer: what there is to choose from.
        output: where drives are kept.
        new_clock: makes the clock of each race.
        blind: whose offer it is, where the opponents stand under letters.
        on_kept: told of each drive that was kept, and the person's car, unless the test is blind.
    """

    def __init__(
        self,
        offer: Offer,
        output: OutputFolder,
        new_clock: Callable[[], Clock] = Clock,
        blind: BlindTest | None = None,
        on_kept: Callable[[Kept, int], None] | None = None,
    ) -> None:
        self.buffer = InputBuffer()
        self.heat: Heat | None = None
        self.kept: list[Kept] = []
        self._offer, self._output, self._new_clock = offer, output, new_clock
        self._blind, self._on_kept = blind, on_kept
        self._letters: Mailbox | None = None
        self._told: list[Words] = []
        self._chosen: Choice | None = None
        self._loop = asyncio.get_running_loop()

    def enter(self) -> Mailbox:
        """A page has come, instead of any that was there; what it is to be told. A race waits for it."""
        self.buffer.clear()
        self._pause()
        letters = self._letters = Mailbox()
        try:
            letters.say(self._choices())
        except InputError as error:
            letters.say({"type": "refused", "why": str(error)})
        if self.heat is not None:
            for words in self._told:
                letters.say(words)
        elif self._blind is not None and self._blind.questions is not None:
            letters.say({"type": "questions", **self._blind.questions})
        return letters

    def go_away(self, letters: Mailbox) -> None:
        """A page has gone: the race waits for it, unless another one has come."""
        if self._letters is letters:
            self._letters = None
            self.buffer.clear()
            self._pause()

    async def hear(self, words: Words) -> None:
        """Do what the page asks.

        Raises:
            InputError: if it asks for nothing that there is.
        """
        match words:
            case {"type": "race", "choice": choice}:
                await self._begin(Choice.read(choice))
            case {"type": "restart"} if self._chosen is not None:
                await self._begin(self._chosen)
            case {"type": "ready"} if self.heat is not None:
                if self._told[-1] != PAUSED:
                    self.heat.go_on()
            case {"type": "pause"} if self.heat is not None:
                self._pause()
            case {"type": "go on"} if self.heat is not None:
                self.heat.go_on()
                self._tell({"type": "going on"})
            case {"type": "mark"} if self.heat is not None:
                self.heat.mark()
            case {"type": "answers", "answers": answers} if self._blind is not None:
                self._blind.answer(answers)
                self._tell(self._choices())
            case {"type": "drop"} if self._blind is not None:
                self._blind.drop()
            case {"type": "cast"} if self._blind is not None:
                self._blind.cast()
                self._tell(self._choices())
            case {"type": "aids", "aids": aids} if self.heat is not None:
                self.heat.aids = Aids.model_validate_json(json.dumps(aids))
            case {"type": "leave"}:
                await self.leave()
            case _:
                raise InputError("the page asks for what there is not, expected a page of this version")

    def _pause(self) -> None:
        if self.heat is not None and self._told[-1] != PAUSED:
            self.heat.pause()
            self._tell(PAUSED)

    async def leave(self) -> None:
        """End the race, if there is one; nothing of it is kept."""
        heat, self.heat = self.heat, None
        if heat is not None:
            await asyncio.to_thread(heat.leave)

    async def _begin(self, choice: Choice) -> None:
        await self.leave()
        if self._blind is not None:
            choice = self._blind.check(choice)
        self._tell({"type": "preparing", "forecast": choice.difficulty != CHOSEN})
        made = await asyncio.to_thread(self._planned, choice)
        scene = await asyncio.to_thread(scenery, choice.circuit, choice.car)
        self._chosen, self._told = choice, []
        self._tell({"type": "race", "scene": scene, **_race(made)})
        heat = Heat(
            made,
            self.buffer,
            partial(self._on_loop, self._on_frame),
            partial(self._on_loop, self._on_incident),
            partial(self._on_loop, partial(self._on_mark, made)),
            self._on_end,
            self._new_clock(),
        )
        self.heat = heat
        # The countdown begins when the page shows the grid: the first pictures may take it seconds.
        heat.pause()
        heat.start()
        if self._letters is None:
            self._pause()

    def _planned(self, choice: Choice) -> DrivePlan:
        if self._blind is not None:
            return self._blind.plan(choice)
        if choice.difficulty == CHOSEN:
            return plan(choice, self._offer)
        check_place(choice, self._offer)
        store, name = self._output.store, choice.name
        return plan(choice, self._offer, field(choice.difficulty, choice.temper, choice.setting, store, name))

    def _on_loop(self, what: Callable[[Any], None], told: Any) -> None:
        # It ends before a race that is under way.
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(what, told)

    def _on_frame(self, frame: bytes) -> None:
        if self._letters is not None:
            self._letters.show(frame)

    def _on_incident(self, incident: Incident) -> None:
        self._tell(
            {
                "type": "stewards",
                "time_s": incident.time_s,
                "text": incident.text,
                "cars": list(incident.cars),
                "penalty_s": incident.penalty_s,
            }
        )

    def _on_mark(self, made: DrivePlan, mark: Mark) -> None:
        self._tell({"type": "marked", **mark._asdict(), "nearest": nearest(made, mark)})

    def _on_end(self, driven: DrivenHeat | None) -> None:
        """On the race's thread: it has ended."""
        kept: Kept | None = None
        played: Words | None = None
        fault = "The race has failed; the terminal says why."
        if driven is not None:
            try:
                kept = keep(driven, self._output)
                played = race_data(driven.log)
            except InputError as error:
                fault = str(error)
        self._on_loop(partial(self._close, driven, played), (kept, fault))

    def _close(self, driven: DrivenHeat | None, played: Words | None, end: tuple[Kept | None, str]) -> None:
        kept, fault = end
        heat, self.heat = self.heat, None
        if kept is not None and driven is not None:
            self.kept.append(kept)
            if self._blind is not None:
                self._blind.ended(driven, kept)
            elif self._on_kept is not None:
                self._on_kept(kept, driven.plan.choice.seat - 1)
            self._tell({"type": "result", **self._result(driven, kept, played)})
        elif heat is not None:
            self._tell({"type": "refused", "why": fault})

    def _tell(self, words: Words) -> None:
        """Tell the page, and any that comes in its place."""
        self._told.append(words)
        if self._letters is not None:
            self._letters.say(words)

    def _result(self, driven: DrivenHeat, kept: Kept, played: Words | None) -> Words:
        result = {"rows": _rows(driven, kept), "car": driven.plan.choice.seat - 1}
        if self._blind is not None:
            return result | {"questions": self._blind.questions}
        expected = driven.plan.field and driven.plan.field.forecast
        return result | {
            "recording": str(kept.recording),
            "inputs": str(kept.inputs),
            "race": played,
            "forecast": expected and expected._asdict(),
        }

    def _choices(self) -> Words:
        return {
            "type": "choices",
            "circuits": self._offer.circuits,
            "cars": self._offer.cars,
            "opponents": [
                {
                    "name": one.name,
                    "drives": [
                        [circuit, car]
                        for circuit in self._offer.circuits
                        for car in self._offer.cars
                        if one.drives(circuit, car)
                    ],
                }
                for one in self._offer.opponents
            ],
            "blind": None if self._blind is None else self._blind.standing(),
            "difficulty": self._offer.difficulty,
            "temper": self._offer.temper,
            "unchosen": self._offer.unchosen,
            "levels": LEVELS,
            "most_laps": MOST_LAPS,
            "most_cars": MOST_CARS,
        }


def _race(made: DrivePlan) -> Words:
    choice = made.choice
    shades = [
        COLOURS[0] if place == choice.seat - 1 else COLOURS[1 + seat.entrant % (len(COLOURS) - 1)]
        for place, seat in enumerate(made.match.races[0].seats)
    ]
    return {
        "choice": choice.model_dump(mode="json"),
        "cars": [
            {"name": name, "colour": colour} for name, colour in zip(numbered(made.grid), shades, strict=True)
        ],
        "countdown_s": COUNTDOWN_S,
        "field": made.field and made.field.words,
    }


def _rows(driven: DrivenHeat, kept: Kept) -> list[Words]:
    grid = driven.plan.grid
    columns = ("place", "car", "ending", "race_time_s", "best_lap_s", "penalties", "contacts")
    rows = kept.results.sort("place").select(columns).to_dicts()
    return [{**row, "name": grid[row["car"]]} for row in rows]


def _plain(value: Any) -> Any:
    """A value as JSON has it: what is no number is null."""
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
