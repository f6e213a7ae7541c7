"""A generation of a league: who met, how it went, and who goes on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import polars as pl
from pydantic import BaseModel, ConfigDict
from scipy.special import expit

from nathlon.arena.entrant import Entrant
from nathlon.lab.league.settings import StopRule
from nathlon.sim.errors import InputError
from nathlon.sim.untrusted_file import read_text
from nathlon.sim.validation import read_json
from nathlon.sim.whole_file import write_whole, writing

GENERATION_FILE = "generation.json"


class Member(BaseModel):
    """One that has met the others in a generation.

    Attributes:
        entrant, name, source: who.
        rank, points_per_race, points_low, points_high, contacts_per_km, contacts_low, contacts_high,
            at_fault_per_km, at_fault_low, at_fault_high, races: see `nathlon.arena.results.RANKING`.
        penalties: a car and race.
        bradley_terry: log-odds to score more in a unit, mean 0.
        kept: whether it is in the population from now on.
        weight: how often it is drawn as an opponent of the next generation; 0 where it is not kept.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    entrant: str
    name: str
    source: str
    rank: int
    points_per_race: float
    points_low: float | None
    points_high: float | None
    contacts_per_km: float | None
    contacts_low: float | None
    contacts_high: float | None
    at_fault_per_km: float | None
    at_fault_low: float | None
    at_fault_high: float | None
    races: int
    penalties: float
    bradley_terry: float
    kept: bool = False
    weight: float = 0.0


class Generation(BaseModel):
    """A generation that has met.

    Attributes:
        number: from 0, the first entrants.
        origin: id of the one that was polished; None at first.
        newcomer: id of what came of it; None at first.
        champion: id of the best of the first entrants, with whom points are compared.
        parent: id of the one to be polished next, and to be sent at the end.
        reached: whether the parent does what the league is for.
        members: the best first.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    number: int
    origin: str | None
    newcomer: str | None
    champion: str
    parent: str
    reached: bool
    members: tuple[Member, ...]

    def member(self, entrant: str) -> Member:
        """The member with an id."""
        return next(member for member in self.members if member.entrant == entrant)

    @property
    def population(self) -> list[Member]:
        """Those that are kept."""
        return [member for member in self.members if member.kept]


class Met(NamedTuple):
    """What a tournament has told of its entrants.

    Attributes:
        ranking, ratings: RANKING and RATINGS.
        results: RESULTS.
    """

    ranking: pl.DataFrame
    ratings: pl.DataFrame
    results: pl.DataFrame


def members(entrants: Sequence[Entrant], met: Met) -> list[Member]:
    """What a tournament has told of each of the entrants, the best first.

    Raises:
        InputError: if one has no race that counts.
    """
    known = {entrant.id: entrant for entrant in entrants}
    penalties = met.results.group_by("entrant").agg(penalties=pl.col("penalties").mean())
    told = met.ranking.join(met.ratings.select("entrant", "bradley_terry"), on="entrant").join(
        penalties, on="entrant", maintain_order="left"
    )
    for row in told.filter(pl.col("rank").is_null()).iter_rows(named=True):
        raise InputError(
            f"{known[row['entrant']].source}: has no race that counts, expected one to compare by"
        )
    wanted = [name for name in Member.model_fields if name in told.columns]
    return [
        Member(name=known[row["entrant"]].name, source=known[row["entrant"]].source, **row)
        for row in told.select(wanted).iter_rows(named=True)
    ]


def conclude(
    number: int,
    met: Sequence[Member],
    size: int,
    stop: StopRule | None,
    before: Generation | None,
    newcomer: str | None,
) -> Generation:
    """Who goes on from a generation, and how often each is drawn.

    The parent is, of those that share the first rank, the one that is least at fault. In the population are
    the parent, the champion and the best of the others. An opponent is drawn by the probability that it
    scores more than the parent, by Bradley and Terry's strengths (as in prioritized fictitious self-play,
    Vinyals et al., Nature 575, 2019).

    Args:
        number: of the generation.
        met: its members, the best first.
        size: of the population.
        stop: what the league is for, if it has an end but its last generation.
        before: the generation before; None for the first.
        newcomer: id of the one that was polished.
    """
    champion = before.champion if before else met[0].entrant
    first = [member for member in met if member.rank == met[0].rank]
    parent = min(first, key=lambda member: (_at_fault(member), -member.points_per_race))
    order = dict.fromkeys([parent.entrant, champion, *(member.entrant for member in met)])
    kept = set(list(order)[:size])
    best = next(member for member in met if member.entrant == champion)
    return Generation(
        number=number,
        origin=before.parent if before else None,
        newcomer=newcomer,
        champion=champion,
        parent=parent.entrant,
        reached=stop is not None and _does(parent, best, stop),
        members=tuple(
            member.model_copy(update={"kept": True, "weight": _beats(member, parent)})
            if member.entrant in kept
            else member
            for member in met
        ),
    )


def _does(parent: Member, champion: Member, stop: StopRule) -> bool:
    """Whether a parent is clean enough, at no loss of points."""
    clean = _at_fault(parent) <= stop.at_fault_per_km
    return clean and parent.points_per_race >= champion.points_per_race - stop.points


def _at_fault(member: Member) -> float:
    """Contacts a kilometre that are laid to it; None if it never moved."""
    return math.inf if member.at_fault_per_km is None else member.at_fault_per_km


def _beats(member: Member, parent: Member) -> float:
    """Probability that one scores more in a unit than the parent."""
    return float(expit(member.bradley_terry - parent.bradley_terry))


def write_generation(folder: Path, generation: Generation) -> None:
    """Keep a generation in its folder, which is made if it is not there.

    Raises:
        InputError: if it cannot be written.
    """
    path = folder / GENERATION_FILE
    with writing(path):
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(path, generation.model_dump_json(indent=1) + "\n")


def read_generation(folder: Path) -> Generation | None:
    """The generation in a folder; None if it has not met yet.

    Raises:
        InputError: if the file is something else.
    """
    path = folder / GENERATION_FILE
    if not path.exists():
        return None
    return read_json(read_text(path, "generation of a league"), Generation, path)
