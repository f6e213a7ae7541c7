"""What a design keeps in its folder, as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError
from pydantic_core import from_json

from nathlon.lab.reward.alignment import Preference
from nathlon.lab.reward.candidates import Candidate, CandidateOutcome
from nathlon.sim.data_file import Section
from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import read_text
from nathlon.sim.validation import check_kinds
from nathlon.sim.whole_file import write_whole

KindT = TypeVar("KindT")
LARGEST_MIB = 16


class JudgedClips(Section):
    """Preferences so far.

    Attributes:
        over: whether no more are to come.
        preferences: in the order in which they came.
    """

    over: bool = False
    preferences: tuple[Preference, ...] = ()


CANDIDATES = TypeAdapter(tuple[Candidate, ...])
JUDGED = TypeAdapter(JudgedClips)
OUTCOMES = TypeAdapter(tuple[CandidateOutcome, ...])


def read_record(path: Path, kind: TypeAdapter[KindT]) -> KindT:
    """What a file keeps.

    Raises:
        InputError: if it cannot be read, or keeps something else.
    """
    text = read_text(path, "part of the design", LARGEST_MIB)
    try:
        made = kind.validate_json(text)
        check_kinds(from_json(text), made)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(map(str, first["loc"])) or "the file"
        raise InputError(f"{path}: {field}: {first['msg']}") from None
    return made


def write_paper(path: Path, kind: TypeAdapter[KindT], value: KindT) -> None:
    """Keep something, whole or not at all, in a folder that is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, kind.dump_json(value, indent=1) + b"\n")


def ranked(outcomes: Sequence[CandidateOutcome]) -> tuple[CandidateOutcome, ...]:
    """The strongest first."""
    return tuple(sorted(outcomes, key=lambda one: -one.strength))
