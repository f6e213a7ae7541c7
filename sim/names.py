"""Names that others have given: shown as they are, and never more than a name."""

from __future__ import annotations

import re

from nathlon.sim.errors import InputError

LONGEST = 100
"""Letters of a name; a longer one loses its middle, as names differ at their ends."""
LONGEST_FILE = 50
"""Letters of a file name: of four bytes each, they leave room for endings below the usual 255 bytes."""


def printable(text: str) -> str:
    r"""Text in one line that no terminal, page or table takes for more than text.

    What is not printable (control characters, line ends, marks that turn the direction of writing, halves of
    surrogate pairs) is written out as in Python's source, a line end as `\n`.
    """
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else _escaped(letter) for letter in text)


def _escaped(letter: str) -> str:
    return letter.encode("unicode_escape").decode("ascii")


def proper_name(text: str) -> str:
    """A name for all that shows names: printable, and no longer than LONGEST."""
    name = printable(text)
    half = LONGEST // 2
    return name if len(name) <= LONGEST else f"{name[: half - 1]}…{name[-half:]}"


def check_new_name(name: str) -> None:
    """Raise InputError for a name that a circuit or car of one's own should not have."""
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name):
        raise InputError(f"--name: {name!r}, expected lowercase letters and digits, with hyphens between")


def file_stem(name: str) -> str:
    """A name as part of a file name, in any folder of any system: letters, digits, `_`, `.` and `-`."""
    return re.sub(r"[^\w.-]+", "-", name).strip(".-")[:LONGEST_FILE].rstrip(".-") or "unnamed"
