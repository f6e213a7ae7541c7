"""The committee's record as its room shows it, and what members add to it there."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import quote

import nathlon.selection.committee as committee
from nathlon.arena.control import steer
from nathlon.arena.store import RunRecord, Store
from nathlon.arena.world_finding import RACING, is_racing
from nathlon.lab.serve.folders import Folders, runs_of
from nathlon.lab.serve.live_report import races_to_look_at
from nathlon.lab.serve.wishes import Compare, Decide, Reopen, Said, Steer, Vote
from nathlon.selection.committee.ballots import Ballot
from nathlon.selection.committee.decision import CommitteeDecision, describe
from nathlon.selection.committee.event_log import EventLog, fold
from nathlon.selection.committee.events import Entry, Opened
from nathlon.selection.committee.sentences import names_in, sentence
from nathlon.selection.publish.output import SUMMARY
from nathlon.sim.errors import InputError

AnswerT = TypeVar("AnswerT")

RUNS = "runs"
"""Under which addresses of the server the files of runs are."""


class RunsRecord:
    """What is in a store of its runs and their committee. Its methods belong to one thread.

    Args:
        target: the store, path or URL.
        folders: of its runs.

    Raises:
        InputError: if there is no store, or no run in it.
    """

    def __init__(self, target: str, folders: Folders) -> None:
        self._store, self._folders = Store.open(target), folders
        self._described: tuple[tuple[str, int], list[dict[str, Any]]] | None = None
        if not runs_of(self._store):
            self.close()
            raise InputError(f"{target}: holds no run, expected one that the committee can judge")

    def close(self) -> None:
        """Let the store go."""
        self._store.close()

    def members(self) -> list[str]:
        """People of the committees of all runs, the last committee's first."""
        found = [
            member
            for run in reversed(runs_of(self._store))
            for entry in reversed(EventLog(self._store, run).entries())
            if isinstance(entry.event, Opened)
            for member in entry.event.settings.members
        ]
        return list(dict.fromkeys(found))

    def last(self) -> str:
        """Name of the last run."""
        return runs_of(self._store)[-1]

    def folder(self, run: str) -> Path | None:
        """Of a run; None where there is none, or no such run."""
        runs = runs_of(self._store)
        return self._folders.of(runs, run) if run in runs else None

    def selection(self, run: str) -> str | None:
        """Name of the last decision on who is sent; None where that was not asked."""
        decision = EventLog(self._store, run).decisions().get("selection")
        return None if decision is None else decision.name

    def version(self, run: str) -> str:
        """Changes when the run's report would.

        Raises:
            KeyError: if there is no such run.
        """
        record = next((record for record in self._store.runs() if record.name == run), None)
        if record is None:
            raise KeyError(run)
        facts = self._store.facts(run)
        last = max((entry.id for entry in EventLog(self._store, run).entries()), default=0)
        folder = self.folder(run)
        made = folder / SUMMARY if folder else None
        made_ns = made.stat().st_mtime_ns if made and made.exists() else 0
        return json.dumps([run, record.status, facts.get("progress"), sorted(facts), last, made_ns])

    def state(self, wanted: str | None) -> dict[str, Any]:
        """All that the page shows of a run, as JSON values.

        Args:
            wanted: its name; the last one by default, or where there is none of this name.
        """
        records = self._store.runs()
        names = [record.name for record in records]
        run = wanted if wanted in names else names[-1]
        facts: Any = self._store.facts(run)
        log = EventLog(self._store, run)
        entries = log.entries()
        folder = self._folders.of(names, run)
        record = next(record for record in records if record.name == run)
        decisions = self._decisions(run, entries)
        progress = None if record.ended_at else facts.get("progress")
        last = entries[-1].id if entries else 0
        drives = folder is not None and is_racing(facts.get("world", RACING))
        return {
            "type": "state",
            "store": self._store.name,
            "runs": [_told(one) for one in records],
            "run": run,
            "outcome": (facts.get("outcome") or {}).get("reason"),
            "progress": progress,
            "decisions": decisions,
            "log": _lines(entries),
            "report": f"/{RUNS}/{quote(run, safe='')}/report/index.html",
            # The report is worth another look when a stage has ended, or somebody has spoken.
            "stands": [record.status, (progress or {}).get("stage"), "summary" in facts, last],
            "races": [race.model_dump(mode="json") for race in races_to_look_at(folder)],
            "drive": f"/drive/{quote(run, safe='')}" if drives else None,
        }

    def _decisions(self, run: str, entries: list[Entry]) -> list[dict[str, Any]]:
        """All decisions, told anew only when something was added: the favour of many takes a while."""
        key = run, entries[-1].id if entries else 0
        if self._described is None or self._described[0] != key:
            told = [_decision(decision) for decision in fold(entries).values()]
            self._described = key, told
        return self._described[1]

    def asked(self, what: Callable[[Store], AnswerT]) -> AnswerT:
        """What a function says of the store."""
        return what(self._store)

    def steer(self, member: str, wish: Steer) -> None:
        """Have the work on the store go on as a member says.

        Raises:
            InputError: if what is to go first is not in the queue.
        """
        if wish.first is not None and wish.first not in self._store.waiting(most=1):
            raise InputError("what is to go first does not wait any more; look at the queue again")
        steer(self._store, member, **wish.changed)

    def add(self, run: str, member: str, said: Said) -> None:
        """Take down what a member says.

        Raises:
            InputError: if it cannot be said, or another question has taken the place of the one meant.
        """
        event_log = EventLog(self._store, run)
        decision = event_log.decisions().get(said.question) if run in runs_of(self._store) else None
        if decision is None or decision.name != said.decision:
            raise InputError("the question has been put anew meanwhile; look at it again")
        match said:
            case Vote(approve=approve, rank=rank, reason=reason):
                _check_candidates(decision, *approve, *rank)
                committee.vote(event_log, decision, member, Ballot(approve, rank), reason)
            case Compare(better=better, worse=worse, reason=reason):
                _check_candidates(decision, better, worse)
                committee.compare(event_log, decision, member, better, worse, reason)
            case Decide():
                committee.close(event_log, decision, member)
            case Reopen(reason=reason):
                committee.reopen(event_log, decision, member, reason)


def _check_candidates(decision: CommitteeDecision, *entrants: str) -> None:
    if not set(entrants) <= set(decision.opened.candidates):
        raise InputError("the ballot names somebody who is no candidate, expected candidates alone")


def _told(record: RunRecord) -> dict[str, Any]:
    return {
        "name": record.name,
        "status": record.status,
        "began_at": record.began_at,
        "ended_at": record.ended_at,
    }


def _decision(decision: CommitteeDecision) -> dict[str, Any]:
    settings = decision.opened.settings
    people = {"members": settings.members, "quorum": settings.quorum}
    return describe(decision).model_dump(mode="json") | people


def _lines(entries: list[Entry]) -> list[dict[str, Any]]:
    names = names_in(entries)
    return [
        {
            "id": entry.id,
            "at": entry.at,
            "event": entry.event.event,
            "decision": entry.event.decision,
            "text": sentence(entry, names),
        }
        for entry in entries
    ]
