"""The proposer that is a language model: what it is told, and how its answer is read."""

from __future__ import annotations

import json
from typing import Any

from nathlon.lab.llm.chat import Message
from nathlon.lab.llm.transcripts import Transcripts
from nathlon.lab.reward.candidates import Brief, CandidateOutcome, Proposal
from nathlon.sim.expressions.functions import FUNCTIONS
from nathlon.sim.expressions.text import LONGEST
from nathlon.sim.instruments import QUANTITIES
from nathlon.sim.names import printable

LONGEST_WHY = 300
MOST_BRACKETS = 20
"""In a reply, at which a list is looked for."""
TASK = """You write reward functions for reinforcement learning of racing cars. A reward is one formula, a \
pure number for one car in one step of 0.1 s; what an agent earns is the sum over all steps, so it must pay \
for driving and make whatever is not wanted expensive. It is a line of text that is parsed, never run as code:
- numbers, and the quantities below, each with a unit. Divide by the unit to get a pure number: \
progress / m. Numbers have units as products: 8 * m, 3 * m/s**2, 5 * deg. 0 goes with any unit.
- + - * /, ** with a whole or half power, parentheses, comparisons (1 or 0), and, or, not, \
A if CONDITION else B.
- functions: {functions}.
- Divide by nothing that may be 0: write 1 / max(speed, 1 * m/s).
Quantities (name, unit, range, meaning):
{quantities}
Thrown out are formulas that are constant, that explode, and that pay for standing still.
Answer with a JSON array only, one object for each formula: {{"formula": "...", "why": "one sentence"}}."""


class Model:
    """Asks a language model for formulas.

    Args:
        transcripts: by which it is asked.
    """

    def __init__(self, transcripts: Transcripts) -> None:
        self._transcripts = transcripts

    def propose(self, brief: Brief) -> list[Proposal]:
        """What the model proposes; nothing if its answer is no list of formulas.

        Raises:
            InputError: if it cannot be asked.
        """
        label = f"round-{brief.number}-propose-{brief.attempt + 1}"
        return read_reply(self._transcripts.ask(label, messages(brief)))[: brief.wanted]


def messages(brief: Brief) -> list[Message]:
    """What a model is told."""
    quantities = "\n".join(
        f"{name}, {one.unit}, {one.low:g} to {one.high:g}, {one.meaning}" for name, one in QUANTITIES.items()
    )
    functions = ", ".join(f"{name} ({one.meaning})" for name, one in FUNCTIONS.items())
    told = [f"The task, in the words of those who judge the driving: {brief.task}"]
    if brief.outcomes:
        told += ["What earlier formulas have led to, the best first:", *map(_outcome, brief.outcomes)]
        told.append("Improve on the best one: change its weights and terms, some a little and some boldly.")
    if brief.remarks:
        told += ["Those who watched said:", *(f"- {remark}" for remark in brief.remarks)]
    if brief.refused:
        told += ["Thrown out of what you proposed:"]
        told += [f"- {formula}: {reason}" for formula, reason in brief.refused]
    told.append(f"Write {brief.wanted} formulas that differ.")
    return [
        {"role": "system", "content": TASK.format(functions=functions, quantities=quantities)},
        {"role": "user", "content": "\n".join(told)},
    ]


def _outcome(one: CandidateOutcome) -> str:
    lap = "no lap completed" if one.lap_s is None else f"lap {one.lap_s:.1f} s"
    seen = one.measured
    return (
        f"- {one.candidate.formula}\n  strength {one.strength:+.2f} in comparisons, {lap}, "
        f"{seen['pace_share']:.0%} of the built-in driver's pace among others, {seen['off_course']:.1%} of "
        f"the time off course, {seen['contacts']:.2f} contacts in 20 s, "
        f"{seen['contacts_at_fault']:.2f} its fault"
    )


def read_reply(reply: str) -> list[Proposal]:
    """The formulas in a model's answer, whatever stands around them; empty if there are none."""
    at = reply.find("[")
    for _ in range(MOST_BRACKETS):
        if at < 0:
            break
        try:
            found, _ = json.JSONDecoder().raw_decode(reply, at)
        except (ValueError, RecursionError):
            found = None
        if isinstance(found, list) and (proposals := [one for item in found for one in _proposal(item)]):
            return proposals
        at = reply.find("[", at + 1)
    return []


def _proposal(item: Any) -> list[Proposal]:
    if isinstance(item, str):
        item = {"formula": item}
    if not isinstance(item, dict) or not isinstance(item.get("formula"), str):
        return []
    why = item.get("why", "")
    said = printable(why.strip())[:LONGEST_WHY] if isinstance(why, str) else ""
    formula = printable(" ".join(item["formula"].split()))[: LONGEST + 1]  # one character more is refused
    return [Proposal(formula=formula, why=said)]
