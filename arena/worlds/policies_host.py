"""Policies that a loader makes of files in another interpreter; see `host.py` beside this file.

As that, it needs the standard library and numpy alone, in Python 3.7 or newer.
"""

from __future__ import annotations

import random
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Callable, Iterator  # noqa: UP035  # of Python 3.7

import numpy as np


class Policies:
    """Policies by numbers, each in one seat, and what is asked of them."""

    def __init__(self, spaces: Callable[[int], Any], load: Callable[..., Any]) -> None:
        """Of a loader, which gets the spaces of a seat by its number."""
        self._spaces, self._load = spaces, load
        self._seated: dict[int, HostedPolicy] = {}
        self._loaded = 0

    def described(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """What is told at first: nothing."""
        return {}, {}

    def answer(
        self, message: dict[str, Any], arrays: dict[str, Any]
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Load a file, begin an episode, or act; and give up what is not needed any more."""
        for number in message.get("dropped", []):
            self._seated.pop(number, None)
        if "path" in message:
            made = HostedPolicy(self._load(Path(message["path"]), *self._spaces(message["seat"])))
            self._loaded += 1
            self._seated[self._loaded] = made
            return {"number": self._loaded, "gives_scores": made.gives_scores}, {}
        seated = self._seated[message["number"]]
        if "seed" in message:
            seated.reset(message["seed"])
            return {}, {}
        return {}, {"action": seated.act(arrays["observation"])}


class HostedPolicy:
    """What a loader has made, in a seat, with the memory of an episode.

    Attributes:
        gives_scores: whether it is a module of PyTorch that is asked for a score of each choice.
    """

    def __init__(self, made: Any) -> None:
        if not callable(getattr(made, "act", made)):
            expected = "what is called with an observation, or has act(observation, memory)"
            raise TypeError(f"gives {type(made).__name__}, expected {expected}")
        torch: Any = sys.modules.get("torch")
        self._torch = torch if torch and isinstance(made, torch.nn.Module) else None
        if self._torch:
            made.eval()
        self._made, self._memory = made, None  # type: Any, Any
        self._remembers = hasattr(made, "act")
        self.gives_scores = bool(self._torch) and not self._remembers
        self._drawn = _seeded(0)

    def reset(self, seed: int) -> None:
        """Begin an episode."""
        self._memory, self._drawn = None, _seeded(seed)
        if callable(getattr(self._made, "reset", None)):
            with self._apart():
                self._made.reset(seed)

    def act(self, observation: Any) -> Any:
        """Numbers (k,): an action, or scores."""
        # A copy, for a policy may write into it.
        seen: Any = int(observation) if observation.ndim == 0 else observation.copy()
        with self._apart():
            return _row(self._answer(seen))

    def _answer(self, seen: Any) -> Any:
        if self._remembers:
            answer = self._made.act(seen, self._memory)
            if not isinstance(answer, tuple) or len(answer) != 2:
                raise TypeError(f"act gives {type(answer).__name__}, expected action and memory")
            action, self._memory = answer
            return action
        if self._torch is None:
            return self._made(seen)
        batch = np.asarray(seen)[None]
        kept = batch.astype(np.float32) if batch.dtype.kind == "f" else batch
        with self._torch.no_grad():
            return self._made(self._torch.as_tensor(kept))

    @contextmanager
    def _apart(self) -> Iterator[None]:
        """While it finds its own random generators."""
        before = _drawn()
        _draw_from(self._drawn)
        try:
            yield
        finally:
            self._drawn = _drawn()
            _draw_from(before)


def _row(answer: Any) -> Any:
    """Numbers (k,) of an answer of any library."""
    if hasattr(answer, "detach"):
        answer = answer.detach().cpu()
    row = np.asarray(answer).ravel()
    if row.dtype.kind not in "biuf":
        raise TypeError(f"gives {row.dtype}, expected numbers")
    return row


def _drawn() -> Any:
    """The states of Python's, numpy's and torch's generators."""
    torch: Any = sys.modules.get("torch")
    return random.getstate(), np.random.get_state(), torch and torch.random.get_rng_state()  # noqa: NPY002


def _draw_from(states: Any) -> None:
    random.setstate(states[0])
    np.random.set_state(states[1])  # noqa: NPY002
    if states[2] is not None:
        sys.modules["torch"].random.set_rng_state(states[2])


def _seeded(seed: int) -> Any:
    """The states of generators that have a seed, below 2**32."""
    torch: Any = sys.modules.get("torch")
    drawn = torch and torch.Generator().manual_seed(seed).get_state()
    return random.Random(seed).getstate(), np.random.RandomState(seed).get_state(), drawn
