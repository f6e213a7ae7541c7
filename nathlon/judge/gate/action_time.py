"""Whether a candidate's actions come in time where it is deployed."""

from __future__ import annotations

from collections.abc import Mapping

from nathlon.arena.decision import Decision
from nathlon.judge.gate.series import RunPair
from nathlon.results.gate import GateFinding
from nathlon.results.standing import ActionTime

FEWEST = 100
"""Actions without which nothing is known of one in a hundred."""


def action_finding(pair: RunPair, most_ms: float, times: Mapping[str, ActionTime | str]) -> GateFinding:
    """The candidate's time for an action, 99th percentile, beside what is allowed.

    Args:
        pair: candidate and champion, whose time is told beside it.
        most_ms: that is allowed.
        times: by id; a sentence where one could not be timed, nothing where one is not timed at all.
    """
    found = times.get(pair.candidate.id, "actions of its kind are not timed")
    asked = GateFinding(measure="action time, ms", unit="", margin=None, counted="actions")
    if isinstance(found, str):
        return asked.model_copy(update={"note": f"{found}; {most_ms:g} ms are allowed"})
    notes = [f"99th percentile on one thread of {found.machine}, {most_ms:g} ms are allowed"]
    notes.append(f"median {found.median_ms:.3g} ms")
    if isinstance(champion := times.get(pair.champion.id), ActionTime):
        notes.append(f"the champion's are {champion.p99_ms:.3g} and {champion.median_ms:.3g} ms")
    verdict = Decision.PASS if found.p99_ms <= most_ms else Decision.FAIL
    if verdict == Decision.PASS and found.actions < FEWEST:
        verdict = Decision.CANNOT_TELL
        notes.append(f"fewer than {FEWEST} actions say nothing of one in a hundred")
    return asked.model_copy(
        update={
            "difference": found.p99_ms,
            "units": found.actions,
            "verdict": verdict,
            "note": "; ".join(notes),
        }
    )
