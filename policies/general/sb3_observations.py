"""How a model of Stable-Baselines3 sees the observations of an environment, as files and spaces tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Space, flatdim
from numpy.typing import NDArray

from nathlon.policies.convolutions import STRIDES, NatureCnn, size_after
from nathlon.policies.general.outputs import in_words
from nathlon.policies.general.wrapped import Part, is_picture, turned
from nathlon.policies.mlp import Mlp
from nathlon.policies.policy import Batch
from nathlon.policies.sources.foreign import MOST_FRAMES
from nathlon.policies.sources.sb3_file import Family, Sb3File
from nathlon.policies.sources.vec_normalize import Normal, Statistics
from nathlon.sim.errors import InputError

MASKED = {"observation", "action_mask"}
"""Keys of observations that say which actions are allowed, as PettingZoo has them; policies see the first."""


@dataclass(frozen=True)
class Observed:
    """What a model makes of flat observations.

    Attributes:
        parts: the arrays that it sees, in the order of its features.
        size: numbers of a flat observation.
        features: numbers that the network gets.
        shape: of an observation where it is one array.
    """

    parts: tuple[Part, ...]
    size: int
    features: int
    shape: tuple[int, ...] | None

    @property
    def plain(self) -> bool:
        """Whether the network gets observations as they are."""
        if len(self.parts) > 1:
            return False
        [part] = self.parts
        made = part.normal or part.features or part.scales or part.turns or part.frames > 1
        return not made and part.at == slice(0, self.size)


def observed_by(
    file: Sb3File, family: Family, seen: Space[Any] | None, frames: int, statistics: Statistics | None
) -> Observed:
    """How a model sees observations.

    Args:
        file: the model's.
        family: of its networks.
        seen: space of the observations; None for one row of numbers of the size that fits.
        frames: how many of them were stacked in training.
        statistics: by which they were normalised.

    Raises:
        InputError: if they are not those of its training, or this cannot be told.
    """
    trained = _trained(file)
    by_key = dict(statistics.by_key) if statistics else {}
    parts: list[Part] = []
    features = 0
    for key, inner, place in _arrays(file, trained, seen, frames):
        wanted = trained.spaces[key] if isinstance(trained, Dict) else trained
        part = _part(file, wanted, inner, place, frames, _normal(statistics, by_key, key))
        prefix = f"{file.features(family)}{f'extractors.{key}.' if isinstance(trained, Dict) else ''}"
        extractor, made = _extractor(file, prefix, wanted, part)
        scales = is_picture(wanted) and file.setting("normalize_images", 1.0) > 0.0
        parts.append(Part(**(vars(part) | {"features": extractor, "scales": scales})))
        features += made
    if by_key and statistics:
        raise InputError(
            f"{statistics.path}: normalises {sorted(by_key)[0]!r}, which {file.path.name!r} does not see, "
            "expected the statistics of its own observations"
        )
    size = flatdim(seen) if seen is not None else sum(prod(part.shape) for part in parts)
    box = seen if isinstance(seen, Box) else trained if seen is None and isinstance(trained, Box) else None
    return Observed(tuple(parts), size, features, None if box is None else tuple(parts[0].shape))


def _trained(file: Sb3File) -> Space[Any]:
    """The space of training."""
    space = file.space("observation_space")
    if space is not None:
        return space
    told = file.section("observation_space")
    shape = told.get("_shape")
    if (
        not isinstance(shape, list)
        or not shape
        or not all(type(size) is int and 0 < size < 1 << 24 for size in shape)
    ):
        raise InputError(f"{file.path}: its observation space cannot be read, expected one of Gymnasium")
    if told.get("dtype") == "uint8" and len(shape) == 3:
        raise InputError(
            f"{file.path}: its observation space of pictures cannot be read, expected one that "
            "Stable-Baselines3 has pickled"
        )
    return Box(-np.inf, np.inf, tuple(shape), np.float32)


def _arrays(
    file: Sb3File, trained: Space[Any], seen: Space[Any] | None, frames: int
) -> list[tuple[str, Space[Any], int]]:
    """The arrays of an observation that a model sees: key, space, and place in the flat observation."""
    inner: dict[str, Space[Any]] = trained.spaces if isinstance(trained, Dict) else {"": trained}
    if seen is None:
        places = np.cumsum([0, *(flatdim(_one_frame(file, space, frames)) for space in inner.values())])
        one = [_one_frame(file, space, frames) for space in inner.values()]
        return [(key, space, int(place)) for key, space, place in zip(inner, one, places, strict=False)]
    if isinstance(seen, Dict) and (isinstance(trained, Dict) or seen.spaces.keys() == MASKED):
        wanted = inner if isinstance(trained, Dict) else {"observation": trained}
        if missing := wanted.keys() - seen.spaces.keys():
            raise InputError(
                f"{file.path}: sees {sorted(missing)[0]!r}, expected {', '.join(map(repr, seen.spaces))} "
                f"as in the observation space {in_words(seen)}"
            )
        starts = dict(zip(seen.spaces, np.cumsum([0, *map(flatdim, seen.spaces.values())]), strict=False))
        if isinstance(trained, Dict):
            return [(key, seen.spaces[key], int(starts[key])) for key in wanted]
        return [("", seen.spaces["observation"], int(starts["observation"]))]
    if isinstance(trained, Dict):
        raise InputError(
            f"{file.path}: sees {in_words(trained)}, expected the observation space {in_words(seen)}"
        )
    return [("", seen, 0)]


def _one_frame(file: Sb3File, space: Space[Any], frames: int) -> Space[Any]:
    """A space of one of the frames that another one is a stack of."""
    if frames == 1 or not isinstance(space, Box):
        return space
    axis = 0 if is_picture(space) else -1
    if space.shape[axis] % frames:
        raise InputError(
            f"{file.path}: sees {in_words(space)}, expected {frames} stacked frames as its settings say"
        )
    part = np.split(np.arange(space.shape[axis]), frames)[0]
    return Box(space.low.take(part, axis), space.high.take(part, axis), dtype=space.dtype.type)


def _normal(statistics: Statistics | None, by_key: dict[str, Normal], key: str) -> Normal | None:
    return by_key.pop(key, None) if statistics else None


def _part(
    file: Sb3File, wanted: Space[Any], seen: Space[Any], place: int, frames: int, normal: Normal | None
) -> Part:
    """One of the arrays that a model sees, whose space in training was `wanted`."""
    try:
        size, expected = flatdim(seen), flatdim(wanted)
    except (ValueError, NotImplementedError):
        raise InputError(f"{file.path}: the observation space {in_words(seen)} cannot be flattened") from None
    at = slice(place, place + size)
    shape = tuple(seen.shape) if isinstance(seen, Box) else (size,)
    if isinstance(wanted, Box):
        # Where the environment stacks frames itself, nothing is left to do.
        for stack in dict.fromkeys((1, frames)):
            axis = 0 if is_picture(seen) and _channels_first(shape) and not normal else -1
            part = Part(at, shape, normal, stack, axis)
            if part.stacked == wanted.shape:
                return _checked(file, part)
            if len(shape) == 3 and turned(part.stacked) == wanted.shape:
                return _checked(file, Part(**(vars(part) | {"turns": True})))
        if len(wanted.shape) > 1 and isinstance(seen, Box):
            raise InputError(
                f"{file.path}: was trained on observations of shape {in_words(wanted.shape)}, as of stacked "
                f"frames, expected {seen.shape} as in {in_words(seen)}{_hint(wanted, seen)}"
            )
    if size != expected:
        raise InputError(
            f"{file.path}: takes {expected} numbers, expected {size} for the observation space "
            f"{in_words(seen)}{_hint(wanted, seen)}"
        )
    return _checked(file, Part(at, (size,), normal))


def _checked(file: Sb3File, part: Part) -> Part:
    """A part, whose statistics have its shape."""
    normal = part.normal
    if normal and normal.mean.shape not in (part.shape, part.stacked):
        raise InputError(
            f"{file.path}: its statistics have shape {in_words(normal.mean.shape)}, "
            f"expected {in_words(part.shape)} as observations have"
        )
    return part


def _channels_first(shape: tuple[int, ...]) -> bool:
    return int(np.argmin(shape)) == 0


def _hint(wanted: Space[Any], seen: Space[Any]) -> str:
    """What to do about frames that may have been stacked."""
    if not isinstance(wanted, Box) or not isinstance(seen, Box) or not len(seen.shape) > 0:
        return ""
    frames, rest = divmod(prod(wanted.shape), max(prod(seen.shape), 1))
    if rest or not 2 <= frames <= MOST_FRAMES:
        return ""
    return (
        f"; if {frames} frames were stacked, write 'frame_stack: {frames}' into a file with its name and the "
        "ending .config.yml, or stack them in the environment"
    )


def _extractor(
    file: Sb3File, prefix: str, wanted: Space[Any], part: Part
) -> tuple[Callable[[NDArray[np.float32]], Batch] | None, int]:
    """What makes features of a part, and how many; None where it is flattened."""
    if f"{prefix}cnn.0.weight" not in file.tensors:
        return None, flatdim(wanted)
    if not isinstance(wanted, Box) or len(wanted.shape) != 3:
        raise InputError(f"{file.path}: has convolutions for {in_words(wanted)}, expected pictures")
    layers: list[tuple[Batch, Batch]] = []
    channels, height, width = wanted.shape
    for index in range(len(STRIDES)):
        weight, bias = (file.tensor(f"{prefix}cnn.{2 * index}.{name}") for name in ("weight", "bias"))
        if (
            weight.ndim != 4
            or weight.shape[1] != channels
            or bias.shape != weight.shape[:1]
            or not weight.size
        ):
            raise InputError(
                f"{file.path}: layer '{prefix}cnn.{2 * index}' is no convolution of {channels} channels"
            )
        layers.append((weight, bias))
        channels = len(bias)
    weight, bias = (file.tensor(f"{prefix}linear.0.{name}") for name in ("weight", "bias"))
    sides = [weight.shape[2] for weight, _ in layers]
    inputs = channels * prod(size_after(height, width, list(zip(sides, STRIDES, strict=True))))
    if weight.shape != (len(bias), inputs) or not inputs:
        raise InputError(
            f"{file.path}: layer '{prefix}linear.0' has shape {weight.shape}, expected {inputs} inputs"
        )
    last = Mlp(((np.ascontiguousarray(weight.T), bias),), "relu", "relu")
    return NatureCnn(tuple(layers), last), len(bias)
