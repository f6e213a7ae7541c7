"""What the numbers that a policy gives mean in an action space."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from gymnasium.spaces import Box, Discrete, MultiDiscrete, Space, Tuple
from numpy.typing import NDArray

from nathlon.sim.errors import InputError
from nathlon.sim.names import proper_name


class IllegalActionError(ValueError):
    """A policy gives numbers that are no action: not finite, no choice that there is, or of another shape."""


def in_words(what: Any) -> str:
    """A space, or numbers of it, on one line that is not too long."""
    return proper_name(_line(what))


@dataclass(frozen=True)
class Outputs:
    """How numbers become an action.

    Attributes:
        box: in a Box, `clip` takes them for the action and clips it to the bounds; `unscale` stretches
            [-1, 1] to the bounds; None if they are no action of a Box.
        discrete: in a Discrete or MultiDiscrete, `argmax` takes them for a score of each choice, `choice` for
            the action itself; None if they are no such action.
        count: how many there are; None if that shows only when the policy acts.
        trained: attributes of the action space that the policy was trained for, as they print on one line.
        masked: whether scores of choices that are not allowed do not count.
    """

    box: Literal["clip", "unscale"] | None
    discrete: Literal["argmax", "choice"] | None
    count: int | None = None
    trained: Mapping[str, str] = field(default_factory=dict)
    masked: bool = False

    def check(self, source: str, space: Space[Any]) -> None:
        """Raise an InputError, which names the source, if they are no action of a space."""
        expected = self._expected(source, space)
        if self.count is not None:
            _check_count(source, self.count, expected, space)
        for name, there in self.trained.items():
            here = _line(getattr(space, name, None))
            if here != there:
                raise InputError(
                    f"{source}: action space has {name} {in_words(here)}, "
                    f"expected {in_words(there)} as in training"
                )

    def decode(
        self,
        source: str,
        row: NDArray[Any],
        space: Space[Any],
        rng: np.random.Generator,
        mask: NDArray[np.bool_] | None = None,
    ) -> Any:
        """The action that a row (k,) of numbers stands for; see `GeneralPolicy.decode`.

        Raises:
            InputError: if they are no action of such a space; it names the source.
            IllegalActionError: if these are no numbers or choices for it.
        """
        _check_count(source, row.size, self._expected(source, space), space)
        if isinstance(space, Box):
            return self._in_box(row, space)
        assert isinstance(space, Discrete | MultiDiscrete)
        if self.masked and mask is not None and mask.size == row.size:
            row = np.where(mask.ravel(), row, -np.inf)
        sizes = np.atleast_1d(space.n if isinstance(space, Discrete) else space.nvec).ravel()
        chosen = _best(row, sizes) if self.discrete == "argmax" else _chosen(row, sizes, space)
        if isinstance(space, Discrete):
            return int(space.start) + int(chosen[0])
        return (chosen.reshape(space.nvec.shape) + space.start).astype(space.dtype)

    def _expected(self, source: str, space: Space[Any]) -> int:
        """How many numbers an action of the space takes."""
        if isinstance(space, Box) and self.box:
            if self.box == "unscale" and not space.is_bounded():
                raise InputError(f"{source}: action space is {in_words(space)}, expected a bounded Box")
            return int(np.prod(space.shape))
        if isinstance(space, Discrete) and self.discrete:
            return int(space.n) if self.discrete == "argmax" else 1
        if isinstance(space, MultiDiscrete) and self.discrete:
            return int(space.nvec.sum() if self.discrete == "argmax" else space.nvec.size)
        kinds = ["Box"] * bool(self.box) + ["Discrete", "MultiDiscrete"] * bool(self.discrete)
        raise InputError(f"{source}: action space is {in_words(space)}, expected {' or '.join(kinds)}")

    def _in_box(self, row: NDArray[Any], space: Box) -> NDArray[Any]:
        if not np.isfinite(row).all():
            raise IllegalActionError(f"gives {in_words(row)}, expected finite numbers")
        # In float64, for bounds of integers may be further apart than their type reaches.
        low, high = space.low.astype(np.float64), space.high.astype(np.float64)
        values = row.astype(np.float64).reshape(space.shape)
        if self.box == "unscale":
            values = low + 0.5 * (values + 1.0) * (high - low)
        if np.issubdtype(space.dtype, np.integer):
            values = np.rint(values)
        return np.asarray(np.clip(values, low, high), space.dtype)


@dataclass(frozen=True)
class Draw:
    """An action drawn from the space, whatever the numbers: uniform, where it has bounds."""

    def check(self, source: str, space: Space[Any]) -> None:
        """Raise an InputError if the space is of another kind."""
        parts = space.spaces if isinstance(space, Tuple) else [space]
        if not all(isinstance(part, Box | Discrete | MultiDiscrete) for part in parts):
            raise InputError(
                f"{source}: action space is {in_words(space)}, expected Box, Discrete or MultiDiscrete, or a "
                "Tuple of them"
            )

    def decode(
        self,
        source: str,
        row: NDArray[Any],
        space: Space[Any],
        rng: np.random.Generator,
        mask: NDArray[np.bool_] | None = None,
    ) -> Any:
        """An action drawn with the generator, which is advanced; the space keeps its own.

        Of a Discrete, choices that the mask does not allow are left out.

        Raises:
            InputError: if the space is of another kind.
        """
        self.check(source, space)
        own = copy(space)
        own.seed(int(rng.integers(2**31)))
        if isinstance(own, Discrete) and mask is not None and mask.size == own.n and mask.any():
            return int(own.sample(mask.astype(np.int8)))
        action = own.sample()
        return int(action) if isinstance(space, Discrete) else action


def _line(what: Any) -> str:
    return " ".join(str(what).split())


def _check_count(source: str, given: int, expected: int, space: Space[Any]) -> None:
    if given != expected:
        raise InputError(
            f"{source}: gives {given} numbers, expected {expected} for the action space {in_words(space)}"
        )


def _best(scores: NDArray[Any], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """The choice of the highest score in each group; minus infinity is a score."""
    if np.isnan(scores).any():
        raise IllegalActionError(f"gives {in_words(scores)}, expected numbers")
    groups = np.split(scores, np.cumsum(sizes)[:-1])
    return np.array([group.argmax() for group in groups], np.int64)


def _chosen(
    row: NDArray[Any], sizes: NDArray[np.int64], space: Discrete[Any] | MultiDiscrete
) -> NDArray[np.int64]:
    """Numbers that are an action, counted from the space's start."""
    counted = row - np.ravel(space.start)
    if not (np.isfinite(row).all() and (counted == np.rint(counted)).all()):
        raise IllegalActionError(f"gives {in_words(row)}, expected whole numbers")
    if not ((counted >= 0) & (counted < sizes)).all():
        raise IllegalActionError(f"gives {in_words(row)}, expected an action of {in_words(space)}")
    return counted.astype(np.int64)
