"""What policies share that run in one process: random generators, the current folder, ranges of numbers.

A policy that is code may change them; neither the simulator nor another policy may notice.
"""

from __future__ import annotations

import os
import random
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from numpy.random import MT19937, BitGenerator
from numpy.random.mtrand import get_bit_generator, set_bit_generator


class Globals:
    """The states of Python's, numpy's and torch's own random generators, and the current folder."""

    def __init__(
        self, python: Any, numpy: BitGenerator, torch: Any, seed: int = 0, folder: str | None = None
    ) -> None:
        """States; that of torch is None where it is not loaded, and comes of `seed` if it is later.

        The folder stays what it is where it is None.
        """
        self._python, self._numpy, self._torch, self._seed = python, numpy, torch, seed
        self._folder = folder

    @classmethod
    def now(cls) -> Globals:
        """As they are."""
        torch: Any = sys.modules.get("torch")
        generator = torch and torch.random.get_rng_state()
        return cls(random.getstate(), get_bit_generator(), generator, folder=_folder())

    @classmethod
    def seeded(cls, seed: int) -> Globals:
        """As they would be after seeding."""
        return cls(random.Random(seed).getstate(), MT19937(seed), None, seed)

    def restore(self) -> None:
        """Make them so."""
        random.setstate(self._python)
        set_bit_generator(self._numpy)
        torch: Any = sys.modules.get("torch")
        if self._torch is not None:
            torch.random.set_rng_state(self._torch)
        elif torch:
            torch.random.default_generator.manual_seed(self._seed)
        if self._folder is not None and self._folder != _folder():
            with suppress(OSError):
                os.chdir(self._folder)


def _folder() -> str | None:
    """The current folder; None if it is gone."""
    try:
        return os.getcwd()
    except OSError:
        return None


@contextmanager
def preserved() -> Iterator[None]:
    """What is drawn in the block comes of generators that are new, and all is afterwards as it was before."""
    with Apart(0).entered():
        yield


class Apart:
    """Global state of one policy's own, which it finds again whenever it is asked."""

    def __init__(self, seed: int) -> None:
        """State seeded with `seed`, a non-negative integer, so that what is drawn from it repeats."""
        self._own = Globals.seeded(seed)

    @contextmanager
    def entered(self) -> Iterator[None]:
        """While the policy runs."""
        before = Globals.now()
        self._own.restore()
        try:
            with np.errstate():
                yield
        finally:
            self._own = Globals.now()
            before.restore()
