"""Who takes part, as a program gives it: paths, names and objects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from nathlon.policies.policy import Policy
from nathlon.policies.remote import local
from nathlon.policies.sources.finding import Found, find
from nathlon.policies.sources.handed_over import hand_over
from nathlon.sim.errors import InputError

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
    if isinstance(candidates, Mapping):
        named = list(candidates.items())
    else:
        alone = isinstance(candidates, str) or not isinstance(candidates, Iterable)
        together: Iterable[Candidate] = [candidates] if alone else candidates  # type: ignore[list-item,assignment]
        named = [(f"{type(one).__name__}-{number}", one) for number, one in enumerate(together, 1)]
    found = Found()
    for name, candidate in named:
        if isinstance(candidate, str | Path):
            found.add(find([local(candidate, endings)], people, endings))
        else:
            source = hand_over(candidate, name)
            found.add(Found([source], {source}))
    return found
