"""What policies share that run in one process: random generators, the current folder, ranges of numbers.

A policy that is code may change them; neither the simulator nor another policy may notice. It may also close
what the process answers and prints through. That process ends at once, while it is known who did it.
"""

from __future__ import annotations

import os
import random
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import MT19937, BitGenerator
from numpy.random.mtrand import get_bit_generator, set_bit_generator

CLOSED = 72
"""With what a process exits in which foreign code has closed what it answers or prints through."""


@dataclass(frozen=True)
class Channels:
    """What a process answers and prints through.

    Attributes:
        files: device and number of the file behind each descriptor.
        streams: standard output and standard error.
    """

    files: Mapping[int, tuple[int, int] | None]
    streams: tuple[Any, Any]

    @classmethod
    def now(cls, pipe: int) -> Channels:
        """Those of this process, which answers through a descriptor."""
        return cls({number: _file(number) for number in (pipe, 1, 2)}, (sys.stdout, sys.stderr))

    @property
    def open(self) -> bool:
        """Whether they are what they were; streams that were exchanged are put back."""
        sys.stdout, sys.stderr = self.streams
        same = all(_file(number) == file for number, file in self.files.items())
        return same and not any(stream.closed for stream in self.streams if stream is not None)


_channels: Channels | None = None


def keep_channels(pipe: int) -> None:
    """From now on, end this process with CLOSED when foreign code has closed its channels.

    Args:
        pipe: descriptor that it answers through.
    """
    global _channels
    _channels = Channels.now(pipe)


def _file(number: int) -> tuple[int, int] | None:
    try:
        found = os.fstat(number)
    except OSError:
        return None
    return found.st_dev, found.st_ino


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
            if _channels is not None and not _channels.open:
                os._exit(CLOSED)
            self._own = Globals.now()
            before.restore()
