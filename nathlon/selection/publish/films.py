"""Episodes of other worlds, played again to be filmed and made to be looked at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import polars as pl

from nathlon.arena.film import Film
from nathlon.arena.film_recording import read_film
from nathlon.arena.filming import can_be_filmed
from nathlon.arena.job import Opening
from nathlon.arena.pool import Pool
from nathlon.arena.recording import recording_name
from nathlon.arena.store import Store
from nathlon.results.summary import Replay
from nathlon.selection.publish.decider import Notable, notable_episodes
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.publish.recordings import run_again
from nathlon.selection.publish.replays import Replays
from nathlon.selection.run import RECORDINGS, OnMatch
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need


def record_films(
    store: Store,
    results: pl.DataFrame,
    tables: Mapping[str, pl.DataFrame],
    episode: str,
    output: OutputFolder,
    pool: Pool,
    on_match: OnMatch,
) -> Replays:
    """Play the notable episodes of a run again, but for those whose films are there already.

    Every one leaves a recording (.mcap) and a video (.webm). Where the world shows nothing, there are none.

    Args:
        store: that holds the matches.
        results: of the run, schema RESULTS.
        tables: of the run, by their names in `nathlon.arena.results.TABLES`.
        episode: what one is called.
        output: where recordings and videos go.
        pool: plays the episodes.
        on_match: told about progress.
    """
    notable = notable_episodes(results, tables["ranking"], episode)
    lost = [one for one in notable if _kept(_place(output, one), one) is None]
    visible, missing = _visible(store, lost, pool)
    missing |= _film(
        store, [one for one in lost if one in visible], tables["entrants"], output, pool, on_match
    )
    replays = []
    for one in notable:
        film = _kept(_place(output, one), one)
        if film is not None:
            replays.append(_replay(one, film, output))
        elif one.match in missing:
            replays.append(Replay(**one._asdict(), missing=missing[one.match]))
    return Replays(tuple(replays), ())


def _place(output: OutputFolder, one: Notable) -> Path:
    return output.races / recording_name(one.match, one.race)


def _kept(path: Path, one: Notable) -> Film | None:
    """The film in a file, if it is of this episode."""
    if not path.exists():
        return None
    try:
        film = read_film(path)
    except InputError:
        return None
    return film if (film.match, film.race) == (one.match, one.race) else None


def _visible(store: Store, episodes: Sequence[Notable], pool: Pool) -> tuple[list[Notable], dict[str, str]]:
    """Those of some episodes of which there are pictures; and by match, why that cannot be told."""
    specs = [store.spec(one.match) for one in episodes]
    places = list(dict.fromkeys((str(spec["world"]), str(spec["scenario"])) for spec in specs))
    answers = pool.open(
        [Opening(f"world {place[0]!r}", can_be_filmed, place, expected="a world") for place in places]
    )
    shown = dict(zip(places, answers, strict=True))
    found, missing = [], {}
    for one, spec in zip(episodes, specs, strict=True):
        answer = shown[spec["world"], spec["scenario"]]
        if isinstance(answer, InputError):
            missing[one.match] = str(answer)
        elif answer:
            found.append(one)
    return found, missing


def _film(
    store: Store,
    episodes: Sequence[Notable],
    entrants: pl.DataFrame,
    output: OutputFolder,
    pool: Pool,
    on_match: OnMatch,
) -> dict[str, str]:
    """Have the pool leave films of episodes; by match, why there is none."""
    wanted: dict[str, list[int]] = {}
    for one in episodes:
        wanted.setdefault(one.match, []).append(one.race)
    if wanted:
        on_match(RECORDINGS, 0, len(wanted))
    missing = {}
    for done, (key, answer) in enumerate(run_again(store, wanted, entrants, pool, output.races), 1):
        if isinstance(answer, InputError):
            missing[key] = str(answer)
        on_match(RECORDINGS, done, len(wanted))
    return missing


def _replay(one: Notable, film: Film, output: OutputFolder) -> Replay:
    recording = _place(output, one)
    video = output.replays / f"{recording.stem}.webm"
    notes = [film.note] if film.note else []
    try:
        need("av", "video", "a video of an episode")
        if not video.exists():
            from nathlon.reports.film_video import write_film_video

            write_film_video(film, video)
    except InputError as error:
        notes.append(f"There is no video: {error}.")
    return Replay(
        **one._asdict(),
        recording=f"../races/{recording.name}",
        video=f"../replays/{video.name}" if video.exists() else None,
        seats=dict(film.seats),
        notes=tuple(notes),
    )
