"""What RL Zoo notes beside its policies of how observations were wrapped in training: `config.yml`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from nathlon.policies.policy_file import opening
from nathlon.policies.sources.foreign import MOST_FRAMES
from nathlon.sim.errors import InputError

MOST_BYTES, MOST_PARTS, DEEPEST = 1 << 16, 5_000, 50
"""Of a file, of what it is made of, and inside one another."""

_PYTHON = "tag:yaml.org,2002:python/"
_HARMLESS = {"Monitor", "TimeLimit", "OrderEnforcing", "PassiveEnvChecker", "RecordEpisodeStatistics"}
"""Wrappers that leave observations and actions as they are."""
_ONLY_REWARDS = re.compile(r"norm_obs['\"]?\s*[=:]\s*False")


@dataclass(frozen=True)
class ZooSettings:
    """How an environment was wrapped.

    Attributes:
        path: of the file, for errors.
        frames: how many observations were stacked.
        normalised: whether observations were.
        wrappers: names of the classes that the environment was wrapped in.
    """

    path: Path
    frames: int
    normalised: bool
    wrappers: tuple[str, ...]

    @classmethod
    def read(cls, path: Path, content: bytes) -> ZooSettings:
        """The settings in a file with these bytes.

        Raises:
            InputError: if they cannot be understood.
        """
        with opening(path):
            try:
                return cls._of(path, _parsed(content))
            except ValueError as error:
                raise InputError(f"{path}: {error}, expected the settings of a run of RL Zoo") from None

    @classmethod
    def _of(cls, path: Path, settings: Any) -> ZooSettings:
        if not isinstance(settings, dict):
            raise ValueError("no names with values")
        frames = settings.get("frame_stack") or 1
        if type(frames) is not int or not 1 <= frames <= MOST_FRAMES:
            raise ValueError(f"frame_stack is {frames!r}, expected 1 to {MOST_FRAMES}")
        normalise = settings.get("normalize") or False
        if isinstance(normalise, dict):
            normalised = normalise.get("norm_obs", True) is not False
        elif isinstance(normalise, str):
            normalised = not _ONLY_REWARDS.search(normalise)
        else:
            normalised = normalise is True
        named = [*_wrappers(settings.get("env_wrapper")), *_wrappers(settings.get("vec_env_wrapper"))]
        classes = (name.rpartition(".")[2] for name in named)
        return cls(path, frames, normalised, tuple(name for name in classes if name not in _HARMLESS))


def made_with(path: Path, content: bytes) -> dict[str, Any]:
    """The arguments that an environment was made with, as `args.yml` with these bytes tells.

    How it is shown is none of them.

    Raises:
        InputError: if the file cannot be understood.
    """
    with opening(path):
        try:
            told = _parsed(content)
            if not isinstance(told, dict):
                raise ValueError("no names with values")
            arguments = told.get("env_kwargs") or {}
            if not isinstance(arguments, dict) or not all(isinstance(name, str) for name in arguments):
                raise ValueError(f"env_kwargs is {arguments!r}")
        except ValueError as error:
            raise InputError(f"{path}: {error}, expected the arguments of a run of RL Zoo") from None
    return {name: value for name, value in arguments.items() if name != "render_mode"}


def alike(one: Any, other: Any) -> bool:
    """Whether two arguments are equal; lists and tuples of the same are."""
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(map(alike, one, other))
    return type(one == other) is bool and one == other


def _wrappers(told: Any) -> Iterator[str]:
    """Names of wrappers: one, or several, each with or without its arguments."""
    match told:
        case str():
            yield told
        case list() | tuple():
            for one in told:
                yield from _wrappers(one)
        case dict():
            for name in told:
                yield from _wrappers(name)
        case None:
            return
        case _:
            raise ValueError(f"env_wrapper is {told!r}")


class _Loader(yaml.SafeLoader):  # type: ignore[misc]  # it has no types
    """Knows tuples and ordered dictionaries of Python, which RL Zoo writes, as plain data."""


def _tuple(loader: _Loader, node: yaml.Node) -> tuple[Any, ...]:
    if not isinstance(node, yaml.SequenceNode):
        raise ValueError("a tuple is no sequence")
    return tuple(loader.construct_sequence(node, deep=True))


def _ordered(loader: _Loader, node: yaml.Node) -> dict[Any, Any]:
    if isinstance(node, yaml.MappingNode):
        return dict(loader.construct_mapping(node, deep=True))
    if not isinstance(node, yaml.SequenceNode):
        raise ValueError("an OrderedDict is no sequence")
    (pairs,) = loader.construct_sequence(node, deep=True) or ((),)
    return dict(pairs)


def _named(loader: _Loader, suffix: str, node: yaml.Node) -> str:
    """A class that is named stands for its name."""
    return suffix


_Loader.add_constructor(f"{_PYTHON}tuple", _tuple)
_Loader.add_constructor(f"{_PYTHON}object/apply:collections.OrderedDict", _ordered)
_Loader.add_multi_constructor(f"{_PYTHON}name:", _named)


def _parsed(content: bytes) -> Any:
    """The values of a YAML text.

    Raises:
        ValueError: if it is none, is too long, or names what it need not.
    """
    if len(content) > MOST_BYTES:
        raise ValueError(f"has {len(content)} bytes, at most {MOST_BYTES} are read")
    try:
        text = content.decode()
        depth = 0
        for number, event in enumerate(yaml.parse(text, yaml.SafeLoader)):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            # Merged ones would be copied, and those inside them.
            merges = isinstance(event, yaml.ScalarEvent) and event.value == "<<"
            if number >= MOST_PARTS or depth > DEEPEST or merges:
                raise ValueError("has too many parts, too deep ones, or merges some")
        return yaml.load(text, _Loader)  # it is derived from the safe one
    except yaml.YAMLError as error:
        raise ValueError(" ".join(str(error).split())) from None
    except (TypeError, RecursionError, OverflowError, AttributeError, KeyError, IndexError) as error:
        raise ValueError(f"is no YAML that makes sense ({error})") from None
