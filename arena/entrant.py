"""Who takes part: a policy by its id, with the facts that reports show."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import polars as pl

from nathlon.arena.results import ENTRANTS
from nathlon.arena.worlds.registry import RACING
from nathlon.policies.checkpoint import ANY
from nathlon.policies.load import load_file, load_policy
from nathlon.policies.sources import COMPOSITE, DRIVER, HUMAN, MPPI, OBJECT, PLUGIN
from nathlon.policies.sources.composite import CompositeSource
from nathlon.policies.sources.human import load_person
from nathlon.policies.sources.identity import policy_id
from nathlon.policies.sources.planned import PlannedSource
from nathlon.sim.errors import InputError
from nathlon.sim.names import printable, proper_name

CIRCUIT, CAR = "lindenring", "gt3"
"""What policies drive when nothing else is said."""


@dataclass(frozen=True)
class Entrant:
    """A policy that races.

    Attributes:
        id: SHA-256 of a file's bytes, of an installed package, or of a composite with all its parts, or the
            built-in driver's name with its settings.
        name: short, unique among the entrants of a run.
        source: path of the file, or the name of the driver or plugin.
        circuit, car: what it drives; empty in a world that has none.
        step, seed: of the training; None where they are not known.
        world: name of the simulator, see `nathlon.arena.worlds.registry`.
    """

    id: str
    name: str
    source: str
    algorithm: str
    circuit: str
    car: str
    step: int | None
    seed: int | None
    world: str = RACING


def enter(source: str, circuit: str, car: str) -> Entrant:
    """The entrant that a user calls by a path or a driver's name.

    Raises:
        InputError: if it cannot drive this car on this circuit, or its name cannot be written down.
    """
    try:
        source.encode()
    except UnicodeEncodeError:
        raise InputError(
            f"{printable(source)}: the name is no UTF-8, expected one that can be written down"
        ) from None
    entrant = _enter(source, circuit, car)
    return replace(entrant, name=proper_name(entrant.name))


def _enter(source: str, circuit: str, car: str) -> Entrant:
    kind, _, name = source.partition(":")
    if kind == DRIVER:
        load_policy(source, circuit, car)
        return Entrant(source, source, source, "built-in driver", circuit, car, None, None)
    if kind == PLUGIN:
        load_policy(source, circuit, car)
        return Entrant(policy_id(source), name, source, "plugin", circuit, car, None, None)
    if kind == OBJECT:
        return Entrant(policy_id(source), name, source, "object", circuit, car, None, None)
    if kind == HUMAN:
        person = load_person(Path(name), circuit, car)
        return Entrant(person.id, f"{HUMAN}:{person.name}", source, "person", circuit, car, None, None)
    if kind == MPPI:
        return _enter_planner(source, circuit, car)
    if source.endswith(COMPOSITE):
        return _enter_composite(source, circuit, car)
    policy = load_file(Path(source))
    card = policy.card
    for field, made_for, wanted in (("circuit", card.circuit, circuit), ("car", card.car, car)):
        if made_for not in (None, ANY, wanted):
            raise InputError(f"{source}: {field} is {made_for!r}, expected {wanted!r}")
    algorithm = card.algorithm or "unknown"
    return Entrant(policy.id, Path(source).stem, source, algorithm, circuit, car, card.step, card.seed)


def _enter_planner(source: str, circuit: str, car: str) -> Entrant:
    planned = PlannedSource.read(source)
    prior = enter(str(planned.path), circuit, car)
    load_policy(source, circuit, car)
    identity = planned.identity
    name = f"{prior.name}+{identity[:6]}"
    return replace(prior, id=identity, name=name, source=source, algorithm=f"MPPI around {prior.algorithm}")


def _enter_composite(source: str, circuit: str, car: str) -> Entrant:
    composite = CompositeSource.read(Path(source))
    for part in composite.file.part:
        # One for another circuit is not checked: there the car may be another.
        if part.circuit in (None, circuit):
            enter(composite.source(part), circuit, car)
    load_policy(source, circuit, car)
    return Entrant(policy_id(source), composite.file.name, source, "composite", circuit, car, None, None)


def weights(sources: Iterable[str]) -> Iterator[Path]:
    """The files of weights among some sources, those of composites and planners in their place."""
    for source in sources:
        if source.endswith(COMPOSITE):
            yield from weights(CompositeSource.read(Path(source)).sources)
        elif source.startswith(f"{MPPI}:"):
            yield PlannedSource.read(source).path
        elif source.partition(":")[0] not in (DRIVER, PLUGIN, OBJECT, HUMAN):
            yield Path(source)


def only_once(entrants: Sequence[Entrant]) -> list[Entrant]:
    """Entrants with unique names; of several with the same contents only the first is kept.

    Raises:
        InputError: if there is none.
    """
    first = list({entrant.id: entrant for entrant in reversed(entrants)}.values())[::-1]
    if not first:
        raise InputError("no checkpoint given, expected at least one")
    shared = Counter(entrant.name for entrant in first)
    return [
        replace(e, name=f"{proper_name(Path(e.source).parent.name)}/{e.name}-{e.id[:6]}")
        if shared[e.name] > 1
        else e
        for e in first
    ]


def entrants_table(entrants: Iterable[Entrant]) -> pl.DataFrame:
    """The ENTRANTS table."""
    rows = [
        {"entrant": e.id, **{name: getattr(e, name) for name in ENTRANTS.names() if name != "entrant"}}
        for e in entrants
    ]
    return pl.DataFrame(rows, schema=ENTRANTS)
