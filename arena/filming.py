"""Episodes of other worlds, played again to be filmed."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import polars as pl

from nathlon.arena.film import Film, FilmCamera
from nathlon.arena.film_recording import write_film
from nathlon.arena.job import Wanted
from nathlon.arena.recorder import Recorded
from nathlon.arena.recording import recording_name
from nathlon.arena.results import VOID_ENDINGS, came_out_alike
from nathlon.arena.watch import Watch
from nathlon.arena.world import Visible
from nathlon.arena.world_registry import home, load_world
from nathlon.sim.errors import InputError

OTHERWISE = "it ended otherwise when it was played again, expected what is stored"


def can_be_filmed(world: str, scenario: str) -> bool:
    """Whether a world shows a scenario.

    Raises:
        InputError: if it cannot be loaded.
    """
    loaded = load_world(world)
    return isinstance(loaded, Visible) and loaded.shows(scenario)


def film_episodes(wanted: Wanted, policies: Sequence[Any], watch: Watch) -> Recorded | InputError:
    """Play the episodes that are wanted again and leave a film of each in the folder.

    Returns:
        their results, without logs; or why there is no film of one, which may be because it came out
        otherwise than it is stored.
    """
    world, folder, rows = home(wanted.match), wanted.folder, []
    if not isinstance(world, Visible) or not world.shows(wanted.match.scenario):
        return InputError(
            f"world {wanted.match.world!r}, scenario {wanted.match.scenario!r}: has no pictures, "
            "expected environments made with render_mode 'rgb_array'"
        )
    assert folder is not None
    assert wanted.results is not None
    for race in wanted.races:
        camera = FilmCamera()
        rows.append(world.replay((wanted.match, policies), race, watch, camera))
        if rows[-1]["ending"].is_in(VOID_ENDINGS).any():
            return InputError(getattr(world, "fault", "") or "the episode is void")
        if not came_out_alike(rows[-1], wanted.results.filter(pl.col("race") == race)):
            return InputError(f"match {wanted.match.key[:10]}, episode {race}: {OTHERWISE}")
        watch.rest()
        try:
            film = _film(wanted, race, camera)
            write_film(folder / recording_name(wanted.match.key, race), film)
        except OSError as error:
            return InputError(f"{folder}: the recording cannot be written: {error.strerror}")
    return Recorded(pl.concat(rows), [])


def _film(wanted: Wanted, race: int, camera: FilmCamera) -> Film:
    match = wanted.match
    seats = home(match).setup(match.scenario).seats
    taken = [wanted.names[seat.entrant] for seat in match.races[race].seats]
    return Film(
        world=match.world,
        scenario=match.scenario,
        match=match.key,
        race=race,
        seed=match.races[race].seed,
        version=version("nathlon"),
        seats=tuple(zip(seats, taken, strict=True)),
        time_s=tuple(camera.time_s),
        pictures=tuple(camera.pictures),
        note=camera.note,
    )
