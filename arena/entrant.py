"""Who takes part: a policy by its id, with the facts that reports show."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import polars as pl

from nathlon.arena.naming import longer, short_names, stem
from nathlon.arena.results import ENTRANTS
from nathlon.arena.world_finding import RACING
from nathlon.policies.checkpoint import ANY
from nathlon.policies.load import load_file, load_policy
from nathlon.policies.sources import COMPOSITE, DRIVER, HUMAN, MPPI, OBJECT, PLUGIN
from nathlon.policies.sources.composite import CompositeSource
from nathlon.policies.sources.human import load_person
from nathlon.policies.sources.identity import policy_id
from nathlon.policies.sources.planned import PlannedSource
from nathlon.sim.errors import InputError
from nathlon.sim.names import proper_name, written

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
        world: name of the simulator, see `nathlon.arena.world_finding`.
        also: other sources with the same contents.
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
    also: tuple[str, ...] = ()


def enter(source: str, circuit: str, car: str) -> Entrant:
    """The entrant that a user calls by a path or a driver's name.

    Raises:
        InputError: if it cannot drive this car on this circuit.
    """
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
    return Entrant(policy.id, stem(source), source, algorithm, circuit, car, card.step, card.seed)


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
    """Entrants with unique names; of several alike in the same car the first is kept, and knows the others.

    Raises:
        InputError: if there is none.
    """
    sources: dict[tuple[str, str], list[str]] = {}
    for entrant in entrants:
        sources.setdefault((entrant.id, entrant.car), []).append(entrant.source)
    first = {(entrant.id, entrant.car): entrant for entrant in reversed(entrants)}
    if not first:
        raise InputError("no checkpoint given, expected at least one")
    kept = [
        replace(first[which], also=tuple(source for source in dict.fromkeys(same) if source != same[0]))
        for which, same in sources.items()
    ]
    return named_apart(kept, short_names(entrant.source for entrant in kept))


def named_apart(
    entrants: Sequence[Entrant], short: Mapping[str, str], taken: Container[str] = ()
) -> list[Entrant]:
    """Entrants with unique names.

    One that is called after its file gets the short name of this; see `nathlon.arena.naming.short_names`.
    Where that is not unique, it gets its car if not all drive the same, the name of a folder more, and then
    the beginning of its id.

    Args:
        entrants: to be named.
        short: names by source.
        taken: names that others have.
    """
    names = [
        proper_name(short.get(e.source, e.name))
        if proper_name(e.name) == proper_name(stem(e.source))
        else e.name
        for e in entrants
    ]
    classes = (_with_car,) if len({e.car for e in entrants}) > 1 else ()
    for with_more in (*classes, _with_folder, _with_id):
        shared = Counter(names)
        names = [
            proper_name(with_more(e, name)) if shared[name] > 1 or name in taken else name
            for e, name in zip(entrants, names, strict=True)
        ]
    return [replace(entrant, name=name) for entrant, name in zip(entrants, names, strict=True)]


def _with_car(entrant: Entrant, name: str) -> str:
    return f"{name} {Path(entrant.car).stem}"


def _with_folder(entrant: Entrant, name: str) -> str:
    return longer(entrant.source, name)


def _with_id(entrant: Entrant, name: str) -> str:
    return f"{name}-{entrant.id[:6]}"


def entrants_table(entrants: Iterable[Entrant]) -> pl.DataFrame:
    """The ENTRANTS table; its sources are `written`."""
    rows = [
        {name: getattr(e, name) for name in ENTRANTS.names() if name != "entrant"}
        | {"entrant": e.id, "source": written(e.source)}
        for e in entrants
    ]
    return pl.DataFrame(rows, schema=ENTRANTS)
