"""An entry of the queue, whatever stands there: checked before anybody races it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError, model_validator

from nathlon.arena.match import BACKGROUND
from nathlon.arena.store import Queued
from nathlon.arena.world_registry import load_world
from nathlon.sim.data_file import Section
from nathlon.sim.errors import InputError
from nathlon.sim.validation import first_fault

LARGEST = 2**63 - 1
"""Whole number that tables have room for."""
KEY_SHOWN = 12
"""Letters of a match's key."""
PLACE = ("world", "circuit", "car", "scenario")

_SOURCES: TypeAdapter[list[str]] = TypeAdapter(list[str])


class DamagedError(InputError):
    """An entry of the queue, or its surroundings, that are of no match, whoever reads them."""


class _Seat(Section):
    entrant: Annotated[int, Field(ge=0)]
    team: Annotated[int, Field(ge=BACKGROUND, le=LARGEST)]


class _Race(Section):
    seed: Annotated[int, Field(ge=0, le=LARGEST)]
    seats: tuple[_Seat, ...]
    mirrored: bool


class _Own(Section):
    """What an entry says of a match beside its surroundings."""

    stage: str
    test: str
    entrants: Annotated[tuple[str, ...], Field(min_length=1)]
    races: Annotated[tuple[_Race, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _seated(self) -> _Own:
        for race in self.races:
            for seat in race.seats:
                if seat.entrant >= len(self.entrants):
                    raise ValueError(
                        f"a seat is entrant {seat.entrant}'s, expected one of {len(self.entrants)}"
                    )
        return self


def digest_of(facts: Any) -> str:
    """SHA-256 in hexadecimal of surroundings, or of surroundings with all that a match adds: then its key."""
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def check_surroundings(facts: Any, digest: str, where: str) -> None:
    """Raise a DamagedError for surroundings that are not those of a digest, or do not say where to race."""
    called = f"{where}: surroundings {digest[:KEY_SHOWN]!r}"
    if digest_of(facts) != digest:
        raise DamagedError(f"{called}: damaged, expected what their digest names; they are out of the queue")
    if not isinstance(facts, dict) or not all(isinstance(facts.get(name), str) for name in PLACE):
        raise DamagedError(f"{called}: expected {', '.join(PLACE)} in them; they are out of the queue")


def check_entry(entry: Queued, facts: Mapping[str, Any], where: str) -> None:
    """See that an entry is a match that can be raced, and the one that its key names.

    Args:
        entry: as the queue has it.
        facts: its surroundings, which have been checked.
        where: name of the store, for the error.

    Raises:
        DamagedError: if it is not.
    """
    if fault := _fault(entry, facts):
        raise DamagedError(f"{where}: match {str(entry.match)[:KEY_SHOWN]}: {fault}; it is out of the queue")


def _fault(entry: Queued, facts: Mapping[str, Any]) -> str | None:
    if not isinstance(entry.spec, dict) or digest_of({**facts, **entry.spec}) != entry.match:
        return "damaged, expected what its key names"
    try:
        own = _Own.model_validate(entry.spec)
        sources = _SOURCES.validate_python(entry.sources)
    except ValidationError as error:
        return first_fault(error, _Own)
    if len(sources) != len(own.entrants):
        return f"has {len(sources)} sources, expected one for each of {len(own.entrants)} entrants"
    setup = load_world(facts["world"], facts["circuit"], facts["car"]).setup(facts["scenario"])
    seats = {len(race.seats) for race in own.races} - {len(setup.seats)}
    return f"has a race of {min(seats)} seats, expected {len(setup.seats)}" if seats else None
