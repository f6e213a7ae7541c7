"""Who takes part, as a program gives it: paths, names and objects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from nathlon.policies.policy import Policy
from nathlon.policies.remote import local
from nathlon.policies.sources import source_and_car
from nathlon.policies.sources.finding import Found, find
from nathlon.policies.sources.handed_over import hand_over
from nathlon.sim.car import load_car
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable

Candidate = str | Path | Policy
"""A checkpoint, a folder or an address of them, `plugin:NAME`, or a policy as an object."""
Candidates = Candidate | Iterable[Candidate] | Mapping[str, Candidate]
"""One, some, or some by the names that their objects shall have."""


def named_sources(candidates: Candidates, people: bool = False, endings: Iterable[str] = ()) -> list[str]:
    """The sources of candidates, with a warning of what is set aside; see `find_candidates`."""
    return find_candidates(candidates, people, endings).warned()


def one_source(
    candidate: Candidate, people: bool = False, endings: Iterable[str] = (), name: str | None = None
) -> str:
    """The source of a candidate that is one policy, an object by `name`; see `find_candidates`.

    Raises:
        InputError: if it is none, or a folder of several.
    """
    sources = named_sources(candidate if name is None else {name: candidate}, people, endings)
    if len(sources) != 1:
        raise InputError(f"{candidate}: holds {len(sources)} checkpoints, expected one policy")
    return sources[0]


def find_candidates(candidates: Candidates, people: bool = False, endings: Iterable[str] = ()) -> Found:
    """What candidates are; objects are handed over, under the names given or those of their classes.

    Args:
        candidates: what a program has given.
        people: whether what a person did is one of them.
        endings: of files that are checkpoints besides those that nathlon reads itself.

    Raises:
        InputError: if one is no policy.
    """
    found = Found()
    for name, candidate in _by_name(candidates):
        found.add(_find_one(name, candidate, people, endings))
    return found


def with_cars(candidates: Candidates, car: str) -> list[tuple[str, str]]:
    """The sources of candidates, each with what it drives.

    A path or name says so as `SOURCE?car=NAME`, and so does the name that an object is given.

    Args:
        candidates: what a program has given.
        car: of those who do not say.

    Raises:
        InputError: if one is no policy, or there is no such car.
    """
    pairs = []
    for name, candidate in _by_name(candidates):
        of_object = not isinstance(candidate, str | Path)
        given = name if of_object else str(candidate)
        called, driven = source_and_car(given)
        if driven is not None:
            _check_car(given, driven)
        found = _find_one(called, candidate if of_object else called)
        pairs += [(source, driven or car) for source in found.warned()]
    return pairs


def _check_car(given: str, car: str) -> None:
    try:
        load_car(car)
    except InputError as error:
        raise InputError(f"{printable(given)}: {error}") from None


def _by_name(candidates: Candidates) -> list[tuple[str, Candidate]]:
    if isinstance(candidates, Mapping):
        return list(candidates.items())
    alone = isinstance(candidates, str) or not isinstance(candidates, Iterable)
    together: Iterable[Candidate] = [candidates] if alone else candidates  # type: ignore[list-item,assignment]
    return [(f"{type(one).__name__}-{number}", one) for number, one in enumerate(together, 1)]


def _find_one(name: str, candidate: Candidate, people: bool = False, endings: Iterable[str] = ()) -> Found:
    if isinstance(candidate, str | Path):
        return find([local(candidate, endings)], people, endings)
    source = hand_over(candidate, name)
    return Found([source], {source})
