"""Judges: who of two drove better, from the same start."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Literal, NamedTuple, Protocol

import numpy as np

from nathlon.lab.llm.chat import Message
from nathlon.lab.llm.transcripts import Transcripts, picture
from nathlon.lab.reward.alignment import Preference
from nathlon.lab.reward.clips import Clips, Studio
from nathlon.lab.reward.measures import Measured, marks, measure, read_rule
from nathlon.lab.reward.pictures import Painter
from nathlon.sim.names import printable

EQUAL = 0.01
"""Marks of two clips that differ by less are the same."""
LONGEST_REMARK = 500
ATTEMPTS = 2


class ClipPair(NamedTuple):
    """Two clips from the same start, by driver."""

    first: str
    second: str
    start: int


class ClipQuestion(NamedTuple):
    """What judges are asked.

    Attributes:
        label: of the occasion, `library` or `round-2`.
        task: in words.
        clips: by driver.
        driver: the built-in driver's.
        pairs: to be judged.
    """

    label: str
    task: str
    clips: Mapping[str, Clips]
    driver: Clips
    pairs: Sequence[ClipPair]


class Judge(Protocol):
    """Compares clips."""

    def judge(self, question: ClipQuestion, on_preference: Callable[[Preference], None]) -> None:
        """Compare pairs, all of them unless people have had enough.

        Args:
            question: what is asked.
            on_preference: told of each as soon as it is there.

        Raises:
            InputError: if it cannot be asked.
        """


class JudgingRule:
    """Judges by what is measured; it does not read the task.

    Args:
        text: an expression of `nathlon.lab.reward.measures.MEASURES`.
        step_s: length of a step, s.

    Raises:
        InputError: if the text is none.
    """

    def __init__(self, text: str, step_s: float) -> None:
        self._rule, self._step_s = read_rule(text), step_s

    def judge(self, question: ClipQuestion, on_preference: Callable[[Preference], None]) -> None:
        """Compare all pairs."""
        measured: dict[str, list[Measured]] = {}
        for pair in question.pairs:
            found = []
            for name in (pair.first, pair.second):
                if name not in measured:
                    measured[name] = measure(question.clips[name], question.driver, self._step_s)
                found.append(marks(self._rule, measured[name][pair.start]))
            first, second = found
            better: Literal[-1, 0, 1] = 0
            if abs(first - second) >= EQUAL:
                better = 1 if first > second else -1
            on_preference(Preference(**pair._asdict(), better=better, remark=f"{first:.2f} : {second:.2f}"))


TASK = """You judge how racing cars are driven, from pictures of two drives, A and B, from the same \
start over {length_s:.0f} s. Each has six pictures in order of time, from above; the car to be judged is \
red. Answer with JSON only: \
{{"better": "A", "B" or "same", "why": "one sentence"}}."""


class JudgingOnlooker:
    """A language model that looks at pictures of clips.

    Args:
        transcripts: by which it is asked.
        studio: where the clips were made.
    """

    def __init__(self, transcripts: Transcripts, studio: Studio) -> None:
        self._transcripts, self._painter, self._step_s = transcripts, Painter(studio), studio.step_s

    def judge(self, question: ClipQuestion, on_preference: Callable[[Preference], None]) -> None:
        """Compare all pairs; an answer that says nothing counts as neither."""
        for pair in question.pairs:
            label = f"{question.label}-judge-{pair.first}-{pair.second}-{pair.start}"
            label = "".join(letter if letter.isalnum() or letter in "-." else "_" for letter in label)
            on_preference(self._judge(label, question, pair))

    def _judge(self, label: str, question: ClipQuestion, pair: ClipPair) -> Preference:
        # Models favour one side: who is A changes from pair to pair, always in the same way.
        turned = bool(np.random.default_rng(list(label.encode())).integers(2))
        names = (pair.second, pair.first) if turned else (pair.first, pair.second)
        length_s = self._step_s * question.driver.driven.shape[1]
        said: list[Message] = [
            {"role": "system", "content": TASK.format(length_s=length_s)},
            {
                "role": "user",
                "content": [
                    {"type": "text", "text": f"What is asked for: {question.task}\nA:"},
                    picture(self._painter.paint(question.clips[names[0]], pair.start)),
                    {"type": "text", "text": "B:"},
                    picture(self._painter.paint(question.clips[names[1]], pair.start)),
                ],
            },
        ]
        for attempt in range(ATTEMPTS):
            reply = self._transcripts.ask(f"{label}-{attempt + 1}", said)
            verdict = read_verdict(reply)
            if verdict is not None:
                better, remark = verdict
                return Preference(
                    **pair._asdict(), better=_turned(better) if turned else better, remark=remark
                )
            said += [
                {"role": "assistant", "content": reply},
                {"role": "user", "content": "Answer with the JSON object only."},
            ]
        return Preference(**pair._asdict(), better=0, remark="no answer")


def _turned(better: Literal[-1, 0, 1]) -> Literal[-1, 0, 1]:
    return {-1: 1, 0: 0, 1: -1}[better]  # type: ignore[return-value]


VERDICTS: dict[str, Literal[-1, 0, 1]] = {"A": 1, "B": -1, "same": 0}


def read_verdict(reply: str) -> tuple[Literal[-1, 0, 1], str] | None:
    """Who is better in a model's answer, and why; None if it does not say."""
    at = reply.find("{")
    try:
        found, _ = json.JSONDecoder().raw_decode(reply, at) if at >= 0 else (None, 0)
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, dict) or found.get("better") not in VERDICTS:
        return None
    why = found.get("why", "")
    return VERDICTS[found["better"]], printable(why.strip())[:LONGEST_REMARK] if isinstance(why, str) else ""
