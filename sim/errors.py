"""The error that a user's own input can cause."""

from __future__ import annotations

from collections.abc import Sequence

END_SHOWN = 1000
"""Characters at the beginning and at the end of a long sentence that are shown."""


class InputError(Exception):
    """Bad input: one sentence naming the file, the field and what was expected.

    The command line prints it as it is and exits with code 2. What it quotes of a file neither breaks the
    line nor steers the terminal nor fills the screen.
    """

    def __str__(self) -> str:
        """The sentence, on one line: what cannot be printed is escaped, the middle of a long one left out."""
        text = super().__str__()
        if len(text) > 2 * END_SHOWN:
            text = f"{text[:END_SHOWN]} ... {text[-END_SHOWN:]}"
        return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def together(errors: Sequence[InputError]) -> InputError:
    """One error that says what several say; at least one must be given."""
    if len(errors) == 1:
        return errors[0]
    return InputError(f"{len(errors)} cannot be used: {'; '.join(map(str, errors))}")
