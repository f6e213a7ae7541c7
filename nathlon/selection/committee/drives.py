"""Test drives as a ballot: what a member who has raced the candidates under letters comes to say of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean

import numpy as np

from nathlon.selection.committee import check_may_vote, vote
from nathlon.selection.committee.ballots import Ballot, favour
from nathlon.selection.committee.decision import CommitteeDecision
from nathlon.selection.committee.event_log import EventLog
from nathlon.selection.committee.events import Answers, Drove, Scores
from nathlon.sim.errors import InputError

QUESTIONS = tuple(Scores.model_fields)
INDIFFERENT = 3.0
"""Of "would you race it again?": whose mean is above is approved."""


@dataclass(frozen=True)
class Opinion:
    """What a member has said of a candidate in all races against it.

    Attributes:
        entrant, letter: the candidate, and the letter under which it raced.
        means: of the scores, by QUESTIONS.
        favour: how often it would be preferred to the others raced; see `ballots.favour`.
    """

    entrant: str
    letter: str
    means: Mapping[str, float]
    favour: float

    @property
    def approved(self) -> bool:
        """Whether the member would rather race it again than not."""
        return self.means["again"] > INDIFFERENT


def opinions(drives: Sequence[Drove]) -> list[Opinion]:
    """Of all candidates raced: those approved first, each in order of favour.

    Ties of favour go by the mean of "again", then by that of all answers, then by letter, which is drawn.
    """
    answers: dict[str, list[Answers]] = {}
    for answer in (answer for drove in drives for answer in drove.answers):
        answers.setdefault(answer.entrant, []).append(answer)
    raced = list(answers)
    support = np.zeros((len(raced), len(raced)), np.int64)
    for drove in drives:
        for answer in drove.answers:
            if drove.better not in (None, answer.entrant):
                support[raced.index(drove.better), raced.index(answer.entrant)] += 1
    liked = favour(support)
    said = [
        Opinion(
            entrant,
            given[0].letter,
            {name: fmean(getattr(answer, name) for answer in given) for name in QUESTIONS},
            float(liked[index]),
        )
        for index, (entrant, given) in enumerate(answers.items())
    ]
    return sorted(said, key=_rank)


def _rank(one: Opinion) -> tuple[bool, float, float, float, str]:
    return (not one.approved, -one.favour, -one.means["again"], -fmean(one.means.values()), one.letter)


def ballot(said: Sequence[Opinion]) -> Ballot:
    """The ballot that follows from opinions in their order."""
    return Ballot(tuple(one.entrant for one in said if one.approved), tuple(one.entrant for one in said))


def note_drive(event_log: EventLog, decision: CommitteeDecision, drove: Drove) -> None:
    """Note a test drive.

    Raises:
        InputError: if the decision is closed, or the member unknown or has voted.
    """
    check_may_drive(decision, drove.member)
    event_log.add(drove)


def check_may_drive(decision: CommitteeDecision, member: str) -> None:
    """Raise InputError if the decision is closed, or the member unknown or has voted."""
    check_may_vote(decision, member)
    if member in decision.ballots():
        raise InputError(
            f"{member} has voted on {decision.name}, expected a member whose vote is not yet cast"
        )


def cast_drives(event_log: EventLog, decision: CommitteeDecision, member: str) -> None:
    """Cast the ballot that follows from a member's test drives.

    Raises:
        InputError: as for `check_may_drive`.
    """
    check_may_drive(decision, member)
    drives = decision.drives_of(member)
    said = opinions(drives)
    vote(event_log, decision, member, ballot(said), _reason(said, drives, decision.opened.candidates))


def _reason(said: Sequence[Opinion], drives: Sequence[Drove], names: Mapping[str, str]) -> str:
    scores = [
        f"{names[one.entrant]} ({one.letter}) {', '.join(f'{q} {mean:.3g}' for q, mean in one.means.items())}"
        for one in said
    ]
    preferred = [
        f"{names[drove.better]} over {names[answer.entrant]}"
        for drove in drives
        if drove.better is not None
        for answer in drove.answers
        if answer.entrant != drove.better
    ]
    parts = [f"blind test drives, of 5: {'; '.join(scores)}"]
    if preferred:
        parts.append(f"preferred {', '.join(preferred)}")
    parts.append(f"recordings {', '.join(_recorded(drove, names) for drove in drives)}")
    return "; ".join(parts)


def _recorded(drove: Drove, names: Mapping[str, str]) -> str:
    marked = [
        f"{moment.time_s:.1f} s" + ("" if moment.nearest is None else f" near {names[moment.nearest]}")
        for moment in drove.moments
    ]
    return drove.recording + (f" (marked {', '.join(marked)})" if marked else "")
