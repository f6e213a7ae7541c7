"""The committee's log in words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from nathlon.committee.events import Compared, Drove, Entry, Opened, Reopened, Voted


def names_in(entries: Iterable[Entry]) -> dict[str, str]:
    """Names of all candidates in a log, by entrant ids."""
    return {
        entrant: name
        for entry in entries
        if isinstance(entry.event, Opened)
        for entrant, name in entry.event.candidates.items()
    }


def sentence(entry: Entry, names: Mapping[str, str]) -> str:
    """What happened.

    Args:
        entry: of the log.
        names: of candidates, by entrant ids.
    """
    match entry.event:
        case Opened(question=question, seats=seats, evidence=evidence):
            return f"{question} of {seats} from {len(evidence.rows)}, on evidence {evidence.digest[:12]}"
        case Voted(member=member, approve=approve, rank=rank, reason=reason):
            fit = ", ".join(names[entrant] for entrant in approve) or "nobody"
            order = " > ".join(names[entrant] for entrant in rank)
            return f"{member} approves {fit}{f', ranks {order}' if order else ''}: {reason}"
        case Compared(member=member, better=better, worse=worse, reason=reason):
            return f"{member} prefers {names[better]} to {names[worse]}: {reason}"
        case Drove(member=member, answers=answers):
            # By their letters: whoever still drives may read this.
            letters = " and ".join(answer.letter for answer in answers)
            return f"{member} raced {letters} without knowing who they are"
        case Reopened(reason=reason):
            return f"reopened: {reason}"
        case closed:
            return f"closed: {', '.join(names[entrant] for entrant in closed.result.chosen) or 'nobody'}"
