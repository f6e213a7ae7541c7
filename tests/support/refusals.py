"""How a faulty file is refused, for the tests of all that is read from files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from nathlon.sim.errors import InputError


@contextmanager
def refusal(path: Path, said: str) -> Iterator[None]:
    """Assert that a file is refused in one line that begins with its path and has the words (a pattern)."""
    with pytest.raises(InputError, match=said) as caught:
        yield
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
