"""Entering policies that may be anything: in the pool's processes, where none can hang or crash this one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from nathlon.arena.entrant import CAR, CIRCUIT, Entrant, only_once, weights
from nathlon.arena.job import Opening
from nathlon.arena.pool import Pool, quietly
from nathlon.arena.world_finding import RACING
from nathlon.arena.world_registry import load_world
from nathlon.arena.worlds.loaded import loader_of
from nathlon.policies.checkpoint import ANY
from nathlon.policies.load import load_file
from nathlon.policies.sources import ROLES
from nathlon.policies.sources.finding import Found
from nathlon.policies.sources.normalisation import check_as_it_is
from nathlon.policies.sources.roles import RolesSource
from nathlon.sim.errors import InputError, together


def enter_each(
    pool: Pool,
    sources: Sequence[str],
    circuit: str,
    car: str,
    world: str = RACING,
    on_opened: Callable[[int, int], None] = quietly,
) -> list[Entrant | InputError]:
    """The entrants that sources give, or why they give none; see `nathlon.arena.world.World`.

    `on_opened` is told how many have been opened, of how many.
    """
    openings = [Opening(source, _enter, (source, world, circuit, car)) for source in sources]
    return pool.open(openings, on_opened)


def _enter(source: str, world: str, circuit: str, car: str) -> Entrant:
    home = load_world(world, circuit, car)
    entrant = home.enter(source)
    parts = RolesSource.read(Path(source)).sources.values() if source.endswith(ROLES) else [source]
    for path in weights(parts):
        # A loader knows what its files were trained on.
        if loader_of(home.loaders, str(path)) is None:
            check_as_it_is(path)
    return entrant


def _enter_again(source: str, world: str, circuit: str, car: str) -> Entrant:
    return load_world(world, circuit, car).enter(source)


def enter_all(
    pool: Pool, sources: Sequence[str], circuit: str, car: str, world: str = RACING
) -> list[Entrant]:
    """Entrants with unique names; of several with the same contents only the first is kept.

    Raises:
        InputError: if some cannot drive, which it all names, or there is none.
    """
    entrants, _ = enter_found(pool, Found(list(sources), set(sources)), circuit, car, world)
    return entrants


def enter_in_cars(pool: Pool, pairs: Sequence[tuple[str, str]], circuit: str) -> list[Entrant]:
    """As `enter_all`, of sources that each have a car of their own.

    Raises:
        InputError: if some cannot drive theirs, which it all names, or there is none.
    """
    once = list(dict.fromkeys(pairs))
    openings = [Opening(source, _enter, (source, RACING, circuit, car)) for source, car in once]
    answers = pool.open(openings, quietly)
    if refused := [answer for answer in answers if isinstance(answer, InputError)]:
        raise together(refused)
    return only_once([answer for answer in answers if isinstance(answer, Entrant)])


def enter_found(
    pool: Pool,
    found: Found,
    circuit: str,
    car: str,
    world: str = RACING,
    on_opened: Callable[[int, int], None] = quietly,
) -> tuple[list[Entrant], dict[str, InputError]]:
    """As `enter_all`, and by their paths why files of folders are set aside, if they cannot drive as well.

    Raises:
        InputError: if some that were named cannot drive, or nobody can; it names them all.
    """
    once = list(dict.fromkeys(found.sources))
    answers = dict(zip(once, enter_each(pool, once, circuit, car, world, on_opened), strict=True))
    refused = {source: answer for source, answer in answers.items() if isinstance(answer, InputError)}
    blamed = [answer for source, answer in refused.items() if source in found.named]
    if blamed or (refused and len(refused) == len(answers)):
        raise together(blamed or list(refused.values()))
    entrants = only_once([answer for answer in answers.values() if isinstance(answer, Entrant)])
    return entrants, found.set_aside | refused


def endings_of(pool: Pool, world: str) -> tuple[str, ...]:
    """Endings of the files that a world's own code reads.

    Raises:
        InputError: if the world cannot be loaded.
    """
    check_world(pool, world)
    return tuple(load_world(world).loaders)


def check_world(pool: Pool, name: str) -> None:
    """Load a world that is not ours in a watched process, before this one does.

    Raises:
        InputError: if it cannot be loaded there.
    """
    if name == RACING:
        return
    [answer] = pool.open([Opening(f"world {name!r}", _load, (name,), expected="a world")])
    if isinstance(answer, InputError):
        raise answer


def _load(name: str) -> None:
    world = load_world(name)
    for scenario in world.scenarios:
        world.setup(scenario)


def trained_on(pool: Pool, sources: Iterable[str]) -> tuple[str, str]:
    """Circuit and car of the first of some files that tells them, or else the environments' own.

    One that cannot be opened tells nothing: whoever enters it says so.

    Raises:
        InputError: if a composite or a planner cannot be read.
    """
    for path in weights(sources):
        [answer] = pool.open([Opening(str(path), home, (path,))])
        if not isinstance(answer, InputError) and None not in answer:
            return answer
    return CIRCUIT, CAR


def home(path: Path) -> tuple[str | None, str | None]:
    """Circuit and car that a file of weights was made for, as far as it tells.

    Raises:
        InputError: if it cannot be read.
    """
    card = load_file(path).card
    circuit, car = (None if name == ANY else name for name in (card.circuit, card.car))
    return circuit, car


def check_opponents(pool: Pool, sources: Iterable[str], beside: Entrant, field: str) -> None:
    """Raise an InputError that names the field for an opponent that cannot play beside an entrant."""
    once = list(dict.fromkeys(sources))
    for answer in enter_each(pool, once, beside.circuit, beside.car, beside.world):
        if isinstance(answer, InputError):
            raise InputError(f"{field}: {answer}")


def intact(pool: Pool, entrants: Sequence[Entrant]) -> list[bool]:
    """Which entrants can still be loaded, and are the same."""
    answers = pool.open(
        [
            Opening(each.source, _enter_again, (each.source, each.world, each.circuit, each.car))
            for each in entrants
        ]
    )
    return [
        isinstance(answer, Entrant) and answer.id == entrant.id
        for answer, entrant in zip(answers, entrants, strict=True)
    ]
