"""Blind test drives: a member of the committee races the finalists of a run under letters, and judges."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from string import ascii_uppercase
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from nathlon.arena.store import Store
from nathlon.arena.world_finding import RACING, is_racing
from nathlon.lab.drive.choice import Choice, DriveOpponent, DrivePlan, Offer, entered, plan
from nathlon.lab.drive.difficulty import CHOSEN
from nathlon.lab.drive.heat import DrivenHeat
from nathlon.lab.drive.keeping import Kept, nearest
from nathlon.policies.temper import FAIR
from nathlon.selection.committee.decision import CommitteeDecision
from nathlon.selection.committee.drives import ballot, cast_drives, check_may_drive, note_drive, opinions
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.committee.events import Answers, Drove, EventMoment, Scores
from nathlon.selection.publish.output import OutputFolder
from nathlon.sim.errors import InputError
from nathlon.sim.names import as_named, printable
from nathlon.sim.validation import read_json

AT_ONCE = 2
"""Finalists in a race: so many can be told apart while one drives, and "which of the two?" asks for them."""
LONGEST_TEXT = 500
"""Letters of what a driver writes after a race."""
DRIVES = "drives"
"""Folder of the run in which they are kept."""


class Questionnaire(BaseModel):
    """What the page has been told after a race.

    Attributes:
        scores: by letter; None for one that the driver did not meet.
        better: the letter that is preferred; None for neither, and where only one was met.
        text: free.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    scores: dict[str, Scores | None]
    better: str | None
    text: Annotated[str, Field(max_length=LONGEST_TEXT)]


class BlindTest:
    """One member's blind drives on the question who is sent.

    All that it tells the page names finalists by their letters, until the member's ballot is cast.

    Attributes:
        offer: the finalists under letters, where the run raced.
        output: where the drives are kept.

    Args:
        folder: of the run.
        store: its store, path or URL.
        member: who drives.

    Raises:
        InputError: if the run has nobody to race or asks nothing, the member may not vote or has voted, or a
            finalist cannot be had any more.
    """

    def __init__(self, folder: Path, store: Path | str, member: str) -> None:
        self._store, self._member = store, member
        with Store.open(store) as opened:
            names = [record.name for record in opened.runs()]
            if not names:
                raise InputError(f"{opened.name}: holds no run, expected one whose finalists have raced")
            self._run = folder.name if folder.name in names else names[-1]
            rows = {
                row["entrant"]: row | {"source": as_named(row["source"])}
                for row in opened.table(self._run, "entrants").to_dicts()
            }
            world = opened.facts(self._run).get("world", RACING)
            decision = EventLog(opened, self._run).decisions().get("selection")
        if decision is None or len(decision.opened.candidates) < AT_ONCE:
            raise InputError(f"{folder}: run {self._run!r} has no finalists to compare, expected two or more")
        check_may_drive(decision, member)
        self._decision = decision.name
        self._letters = letters(f"{self._run}\n{member}", list(decision.opened.candidates))
        finalists = [rows[entrant] for entrant in self._letters.values()]
        if not is_racing(str(world)):
            raise InputError(f"{folder}: its finalists race no cars, expected a run of nathlon's own world")
        circuit, car = finalists[0]["circuit"], finalists[0]["car"]
        found = entered([row["source"] for row in finalists], circuit, car)
        for row, entrant in zip(finalists, found, strict=True):
            if entrant.id != row["entrant"]:
                raise InputError(f"{row['source']}: has changed since the run, expected the same file")
        opponents = [
            DriveOpponent(row["source"], letter, circuit, car)
            for letter, row in zip(self._letters, finalists, strict=True)
        ]
        self.offer = Offer(tuple(opponents), (circuit,), (car,))
        self._folder, self.output = folder, OutputFolder(folder / DRIVES)
        self._unanswered: tuple[DrivenHeat, Kept] | None = None

    @contextmanager
    def _asked(self) -> Iterator[tuple[EventLog, CommitteeDecision]]:
        """The log, and the question as it stands now.

        Raises:
            InputError: if another question has taken its place.
        """
        with Store.open(self._store) as store:
            event_log = EventLog(store, self._run)
            decision = event_log.decisions()["selection"]
            if decision.name != self._decision:
                raise InputError("the run has been judged anew, expected to be started again")
            yield event_log, decision

    def check(self, choice: Choice) -> Choice:
        """The choice, in the member's own name.

        Raises:
            InputError: if the race before is not answered, it is not against two finalists, or the vote is
                cast.
        """
        if self._unanswered is not None:
            raise InputError("the race before is not answered, expected its questionnaire first")
        if (choice.difficulty, choice.temper) != (CHOSEN, FAIR):
            raise InputError("the choice: names a difficulty, expected two finalists as they are")
        wanted = len(set(choice.opponents))
        if wanted != AT_ONCE or choice.cars <= AT_ONCE:
            raise InputError(
                f"the choice: {wanted} opponents and {choice.cars} cars, expected two and at least three"
            )
        with self._asked() as (_, decision):
            check_may_drive(decision, self._member)
        return choice.model_copy(update={"name": self._member})

    def plan(self, choice: Choice) -> DrivePlan:
        """The race, with the finalists under their letters: so they are recorded, and named by stewards.

        Raises:
            InputError: if one cannot be loaded any more; it does not say which.
        """
        by_entrant = self._by_entrant
        try:
            made = plan(choice, self.offer)
            finalists = [replace(one, name=by_entrant[one.id]) for one in made.entrants[:-1]]
        except (InputError, KeyError):
            raise InputError("a finalist cannot be loaded, expected the files of the run") from None
        return made._replace(entrants=(*finalists, made.entrants[-1]))

    @property
    def _by_entrant(self) -> dict[str, str]:
        return {entrant: letter for letter, entrant in self._letters.items()}

    def ended(self, driven: DrivenHeat, kept: Kept) -> None:
        """Note a race that is to be asked about."""
        self._unanswered = driven, kept

    def drop(self) -> None:
        """Leave the last race out: it says nothing."""
        self._unanswered = None

    @property
    def questions(self) -> dict[str, Any] | None:
        """What the page is to ask; None if there is nothing."""
        if self._unanswered is None:
            return None
        driven, _ = self._unanswered
        marks = [
            {"time_s": mark.time_s, "nearest": nearest(driven.plan, mark), "apart_m": mark.apart_m}
            for mark in driven.marks
        ]
        return {"letters": list(self._raced(driven.plan)), "marks": marks, "longest": LONGEST_TEXT}

    def _raced(self, made: DrivePlan) -> dict[str, str]:
        """Letters of those in a race, with their ids."""
        names = sorted(entrant.name for entrant in made.entrants[:-1])
        return {letter: self._letters[letter] for letter in names}

    def answer(self, told: object) -> None:
        """Note the answers about the last race; if nobody was met in it, it is left out.

        Raises:
            InputError: if they do not fit it, or the vote is cast.
        """
        if self._unanswered is None:
            raise InputError("there is no race to answer for, expected one that has ended")
        driven, kept = self._unanswered
        raced = self._raced(driven.plan)
        answers = read_answers(told, raced)
        met = {letter: scores for letter, scores in answers.scores.items() if scores is not None}
        if not met:
            return self.drop()
        drove = Drove(
            decision=self._decision,
            member=self._member,
            answers=tuple(
                Answers(entrant=entrant, letter=letter, **met[letter].model_dump())
                for letter, entrant in raced.items()
                if letter in met
            ),
            better=None if answers.better is None else raced[answers.better],
            text=printable(answers.text.strip()),
            recording=kept.recording.relative_to(self._folder).as_posix(),
            moments=tuple(
                EventMoment(**mark._asdict() | {"nearest": self._entrant_near(driven.plan, mark.nearest)})
                for mark in driven.marks
            ),
        )
        with self._asked() as (event_log, decision):
            note_drive(event_log, decision, drove)
        self._unanswered = None

    def _entrant_near(self, made: DrivePlan, car: int | None) -> str | None:
        return None if car is None else self._letters[made.grid[car]]

    def cast(self) -> None:
        """Cast the ballot that follows from all answers.

        Raises:
            InputError: if a letter has not been met in a race, or the vote is cast.
        """
        with self._asked() as (event_log, decision):
            if missing := self._missing(decision):
                raise InputError(f"{', '.join(missing)} not met yet, expected each letter at least once")
            cast_drives(event_log, decision, self._member)
        self.drop()

    def _races(self, decision: CommitteeDecision) -> dict[str, int]:
        """How often each letter has been met in a race."""
        drives = decision.drives_of(self._member)
        raced = [answer.entrant for drove in drives for answer in drove.answers]
        return {letter: raced.count(entrant) for letter, entrant in self._letters.items()}

    def _missing(self, decision: CommitteeDecision) -> list[str]:
        return [letter for letter, races in self._races(decision).items() if not races]

    def standing(self) -> dict[str, Any]:
        """How far the member has come, as the page shows it: the names only once the ballot is cast."""
        with self._asked() as (_, decision):
            races = self._races(decision)
            drives = decision.drives_of(self._member)
            cast = decision.ballots().get(self._member)
            names = decision.opened.candidates
        by_entrant = self._by_entrant
        said = ballot(opinions(drives)) if cast is None else cast
        return {
            "driver": self._member,
            "races": races,
            "next": self._next([{a.letter for a in drove.answers} for drove in drives], races),
            "missing": self._missing(decision),
            "approve": [by_entrant[entrant] for entrant in said.approve],
            "rank": [by_entrant[entrant] for entrant in said.rank],
            "names": None if cast is None else {x: names[entrant] for x, entrant in self._letters.items()},
        }

    def _next(self, raced: list[set[str]], races: Mapping[str, int]) -> list[int]:
        """The pair that has met least, of those the one whose letters have been raced least."""
        order = list(races)

        def met(pair: tuple[str, str]) -> tuple[int, int]:
            return raced.count(set(pair)), races[pair[0]] + races[pair[1]]

        return [order.index(letter) for letter in min(combinations(order, 2), key=met)]


def read_answers(told: object, raced: Collection[str]) -> Questionnaire:
    """What the page has told after a race against the finalists of these letters.

    Raises:
        InputError: if it does not fit them.
    """
    answers = read_json(json.dumps(told), Questionnaire, "the answers")
    if set(answers.scores) != set(raced) or answers.better not in (None, *raced):
        raise InputError(f"the answers: expected some for {' and '.join(raced)}")
    if answers.better is not None and None in answers.scores.values():
        raise InputError("the answers: better names one of two, expected null where only one was met")
    return answers


def letters(drawn_for: str, entrants: list[str]) -> dict[str, str]:
    """Entrants by letters, in an order drawn for somebody: always the same for the same text.

    Raises:
        InputError: if there are more than letters.
    """
    if len(entrants) > len(ascii_uppercase):
        raise InputError(f"{len(entrants)} finalists, expected at most {len(ascii_uppercase)}")
    seed = int.from_bytes(hashlib.sha256(drawn_for.encode()).digest())
    drawn = np.random.default_rng(seed).permutation(len(entrants))
    ordered = sorted(entrants)
    return {letter: ordered[index] for letter, index in zip(ascii_uppercase, drawn, strict=False)}
