"""Having a language model phrase what the coach says, and refusing what is not in the facts."""

from __future__ import annotations

import re
from typing import NamedTuple

from pydantic import BaseModel

from nathlon.lab.llm.chat import Endpoint, Message
from nathlon.results.coach import CoachFacts
from nathlon.sim.errors import InputError

ATTEMPTS = 2
MOST_CHARACTERS = 20_000
TASK = (
    "You rewrite notes of a racing coach as a short, friendly text for the driver, in English. Say only what "
    "is in the notes. Do not add up, convert or reword numbers: write them in digits with the unit that they "
    "have, rounded at most. Do not name anybody or any place that is not in the notes. Keep each number in a "
    "sentence with the section that it belongs to. No headings, no Markdown."
)
UNITS = {
    **dict.fromkeys(("second", "seconds", "sec"), "s"),
    **dict.fromkeys(("metre", "metres", "meter", "meters"), "m"),
    "percent": "%",
    "kph": "km/h",
}
NUMBER = re.compile(
    r"(?<![\w.])(?<![A-Za-z]-)(\d+(?:\.\d+)?)\s*(km/h|kph|m/s²|m/s|%|percent|seconds?|sec|met(?:re|er)s?|[ms](?![\w/]))?"
)
NUMERALS = re.compile(
    r"zero|one|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|twenty|thirty|fifty|hundred|thousand|"
    r"half|quarter|third|tenths?|hundredths?|thousandths?|dozen|twice|double|triple",
    re.IGNORECASE,
)
"""Numbers in words, which cannot be checked: they are refused unless the notes have them."""
OPENERS = re.compile(
    r"a|all|also|an|and|as|ask|at|because|before|both|brake|braking|but|by|carry|compared|do|drive|driving|each|"
    r"finally|first|focus|for|from|get|great|go|here|however|if|in|into|it|its|keep|lastly|let|look|more|most|"
    r"next|no|now|of|on|once|or|otherwise|overall|over|so|start|still|take|that|the|then|there|these|they|this|"
    r"those|through|to|together|try|under|well|what|when|where|while|with|you|your",
    re.IGNORECASE,
)
"""Words with which a sentence may begin though the notes do not have them."""
SENTENCE = re.compile(r"(?<=[.!?])\s+|\n+")
LISTED = re.compile(r"; |, | and ")
WORD = re.compile(r"[^\W_]+(?:[-'’][^\W_]+)*")


class Phrasing(BaseModel):
    """What a model said, and why it was refused; empty if it was not."""

    reply: str
    refused: list[str]


class Phrased(NamedTuple):
    """What came of it.

    Attributes:
        text: the model's, or None if all it said was refused.
        attempts: what it said.
        unasked: why it could not be asked; empty if it could.
    """

    text: str | None
    attempts: tuple[Phrasing, ...]
    unasked: str = ""


def phrase(facts: CoachFacts, notes: str, endpoint: Endpoint) -> Phrased:
    """Have a model say the coach's notes in its own words.

    Args:
        facts: of which names are known.
        notes: the coach's own sentences.
        endpoint: the model.
    """
    messages: list[Message] = [{"role": "system", "content": TASK}, {"role": "user", "content": notes}]
    attempts: list[Phrasing] = []
    for _ in range(ATTEMPTS):
        try:
            reply = endpoint.say(messages).strip()
        except InputError as error:
            return Phrased(None, tuple(attempts), str(error))
        attempts.append(Phrasing(reply=reply, refused=unfounded(facts, notes, reply)))
        if not attempts[-1].refused:
            return Phrased(reply + "\n", tuple(attempts))
        why = "Not in the notes: " + "; ".join(attempts[-1].refused) + ". Write it again without."
        messages += [{"role": "assistant", "content": reply}, {"role": "user", "content": why}]
    return Phrased(None, tuple(attempts))


def unfounded(facts: CoachFacts, notes: str, reply: str) -> list[str]:
    """What a text says that the notes do not: numbers, and names.

    A number is known if the notes have it with that unit, or one that is it when rounded; in a sentence that
    names sections of the circuit, if they have it about one of these. A name is a word with a capital letter
    or a digit; it is known if the notes have it, and where a sentence begins also as a usual word.
    """
    if not reply or len(reply) > MOST_CHARACTERS or not all(c.isprintable() or c == "\n" for c in reply):
        return ["anything that can be read"]
    names = _names(facts)
    sections = [one.name for one in facts.sections]
    about_what = _subjects(notes, sections)
    words = set(WORD.findall(notes))
    spoken = {word.lower() for word in words}
    found: list[str] = []
    for sentence in SENTENCE.split(reply):
        about = _named(sentence, sections)
        known = [line for subject, line in about_what if not about or subject in about]
        numbers = _numbers("\n".join(known), names)
        found += [
            f"{value} {unit}".strip() + (f" in {' and '.join(about)}" if about else "")
            for value, unit in _numbers(sentence, names)
            if not _is_known(value, unit, numbers)
        ]
        for place, word in enumerate(WORD.findall(_without(sentence, names))):
            usual = place == 0 and word[1:] == word[1:].lower()
            if word in words or (usual and (word.lower() in spoken or OPENERS.fullmatch(word))):
                continue
            proper = word != word.lower() or (not word.isdigit() and any(c.isdigit() for c in word))
            if proper or NUMERALS.fullmatch(word):
                found.append(word)
    return list(dict.fromkeys(found))


def _named(text: str, sections: list[str]) -> list[str]:
    """Sections that a text names, the first one first."""
    places = {name: re.search(rf"(?<!\w){re.escape(name)}(?!\w)", text) for name in sections}
    return sorted((name for name, place in places.items() if place), key=lambda name: text.index(name))


def _subjects(notes: str, sections: list[str]) -> list[tuple[str | None, str]]:
    """The coach's notes in pieces, each with the section that it is about."""
    found: list[tuple[str | None, str]] = []
    for line in notes.splitlines():
        if line.startswith("   ") and found:
            found.append((found[-1][0], line))
        elif re.match(r"- |\d+\. ", line):
            found.append((next(iter(_named(line, sections)), None), line))
        else:
            named = _named(line, sections)
            pieces = LISTED.split(line) if len(named) > 1 else [line]
            found += [(next(iter(_named(piece, sections)), None), piece) for piece in pieces]
    return found


def _names(facts: CoachFacts) -> list[str]:
    """All names of the facts, the longest first."""
    craft = facts.craft
    others = [one.car for one in craft.passes]
    others += [one.car for one in craft.defences] + [one.car for one in craft.contacts]
    causes = [cause.car for section in facts.sections for cause in section.causes if cause.car]
    own = [facts.name, facts.other, facts.raced.circuit, facts.raced.car, facts.raced.scenario]
    return sorted({*own, *others, *causes, *(one.name for one in facts.sections)}, key=len, reverse=True)


def _without(text: str, names: list[str]) -> str:
    for name in names:
        text = text.replace(name, " , ")
    return text


def _numbers(text: str, names: list[str]) -> list[tuple[str, str]]:
    """Numbers of a text with their units, names apart."""
    return [(value, UNITS.get(unit, unit)) for value, unit in NUMBER.findall(_without(text, names))]


def _is_known(value: str, unit: str, known: list[tuple[str, str]]) -> bool:
    digits = len(value.partition(".")[2])
    for other, its_unit in known:
        exact = len(other.partition(".")[2])
        rounded = digits < exact and float(value) != 0.0 and round(float(other), digits) == float(value)
        if (float(value) == float(other) or rounded) and (not unit or not its_unit or unit == its_unit):
            return True
    return False
