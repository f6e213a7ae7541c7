"""Names that others have given: shown as they are, and never more than a name."""

from __future__ import annotations

import re
from collections import Counter

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


_BYTE = re.compile(r"[\udc80-\udcff]|\\(?=udc[89a-f][0-9a-f]|x5c)")
_WRITTEN = re.compile(r"\\udc[89a-f][0-9a-f]|\\x5c")


def written(path: str) -> str:
    r"""A path for tables and files, which hold UTF-8: a byte of it that is none is `\udcXX`.

    Every other path stays as it is, unless it has such a sequence itself.
    """
    return _BYTE.sub(lambda found: "\\x5c" if found[0] == "\\" else _escaped(found[0]), path)


def as_named(text: str) -> str:
    """The path that `written` has written, to open it."""
    return _WRITTEN.sub(lambda found: found[0].encode("ascii").decode("unicode_escape"), text)


def _escaped(letter: str) -> str:
    return letter.encode("unicode_escape").decode("ascii")


def proper_name(text: str) -> str:
    """A name for all that shows names: printable, and no longer than LONGEST."""
    name = printable(text)
    half = LONGEST // 2
    return name if len(name) <= LONGEST else f"{name[: half - 1]}…{name[-half:]}"


def check_new_name(name: str) -> None:
    """Raise InputError for a name that your own circuit or car should not have."""
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name):
        raise InputError(f"--name: {name!r}, expected lowercase letters and digits, with hyphens between")


def settings_of(given: str, where: str) -> list[tuple[str, str]]:
    """Names and values of `laps=4,grip=0.65`.

    Args:
        given: what stands behind a name; may be empty.
        where: what it stands behind, for the error.

    Raises:
        InputError: if a setting is given twice.
    """
    settings = [(key, value) for key, _, value in (one.partition("=") for one in given.split(",") if one)]
    for key, times in Counter(key for key, _ in settings).items():
        if times > 1:
            raise InputError(f"{where}: setting {key} is given {times} times, expected it once")
    return settings


def file_stem(name: str) -> str:
    """A name as part of a file name, in any folder of any system: letters, digits, `_`, `.` and `-`."""
    return re.sub(r"[^\w.-]+", "-", name).strip(".-")[:LONGEST_FILE].rstrip(".-") or "unnamed"
