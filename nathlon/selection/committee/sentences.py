"""The committee's log in words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from nathlon.selection.committee.events import Comparison, Drove, Entry, Opened, Reopened, Voted


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
            shown = f"evidence {evidence.digest[:12]}"
            return f"asked by the run: {question} of {seats} from {len(evidence.rows)}, on {shown}"
        case Voted(member=member, approve=approve, rank=rank, reason=reason):
            fit = ", ".join(names[entrant] for entrant in approve) or "nobody"
            order = " > ".join(names[entrant] for entrant in rank)
            return f"{member} approves {fit}{f', ranks {order}' if order else ''}: {reason}"
        case Comparison(member=member, better=better, worse=worse, reason=reason):
            return f"{member} prefers {names[better]} to {names[worse]}: {reason}"
        case Drove(member=member, answers=answers):
            # By their letters: whoever still drives may read this.
            letters = " and ".join(answer.letter for answer in answers)
            return f"{member} raced {letters} without knowing who they are"
        case Reopened(member=member, reason=reason):
            return f"reopened{_by(member)}: {reason}"
        case closed:
            chosen = ", ".join(names[entrant] for entrant in closed.result.chosen) or "nobody"
            return f"closed{_by(closed.member)}: {chosen}"


def _by(member: str | None) -> str:
    return "" if member is None else f" by {member}"
