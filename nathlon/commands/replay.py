"""`nathlon replay`."""

from __future__ import annotations

import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from nathlon.commands.options import AsJson, Out
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need
from nathlon.sim.process import typed
from nathlon.sim.whole_file import check_output, writing
from nathlon.terminal import print_json, say, tell, warn


def replay(
    source: Annotated[
        str, typer.Argument(help="Recording of a race (.mcap); with RACE, the store: its path or URL.")
    ],
    race: Annotated[
        str | None,
        typer.Argument(help="Race of the store to run again, as KEY:RACE; the key's first digits suffice."),
    ] = None,
    car: Annotated[
        str | None, typer.Option(help="Name or number of the car to follow; the winner by default.")
    ] = None,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the viewer.")] = True,
    web: Annotated[
        bool, typer.Option("--web", help="Serve Rerun's viewer to browsers on this machine.")
    ] = False,
    html: Annotated[Path | None, typer.Option(help="Write a page that plays the race instead.")] = None,
    video: Annotated[Path | None, typer.Option(help="Write a clip (.mp4) instead.")] = None,
    start_s: Annotated[float | None, typer.Option("--from", help="Start of the clip in the race, s.")] = None,
    end_s: Annotated[float | None, typer.Option("--to", help="End of the clip, s.")] = None,
    recover: Annotated[
        bool, typer.Option("--recover", help="Save what can be read of a damaged recording.")
    ] = False,
    out: Out = Path("runs/replays"),
    as_json: AsJson = False,
) -> None:
    """Look at a race or an episode: in Rerun, in the browser, as a page of its own, or as a video."""
    if race is None and not Path(source).exists():
        raise InputError(f"{source}: no such file, expected a recording")
    if race is not None and Path(race).suffix == Path(source).suffix == ".mcap":
        raise InputError(
            f"{race}: is a second recording, expected one; "
            f"{typed('twin', source, race, '--car', 'N')} shows both"
        )
    if recover:
        _recover(Path(source), as_json)
        return
    if html is not None:
        check_output(html.parent)
    if video is not None:
        check_output(video, is_file=True)
    if race is not None:
        check_output(out)
    from nathlon.arena.film_recording import holds_film
    from nathlon.arena.store import Store
    from nathlon.selection.publish.replays import record_stored_race

    path, made = Path(source), dict[str, Any]()
    if race is not None:
        with Store.open(source) as store:
            path = made["recording"] = record_stored_race(store, race, out)
    if holds_film(path):
        only = {"--car": car, "--html": html, "--from": start_s, "--to": end_s}
        if given := [option for option, value in only.items() if value is not None]:
            raise InputError(f"{path}: is an episode in pictures: expected no {given[0]}, which is for races")
        rerun = _make_film(path, video, made)
    else:
        rerun = _make_race(path, car, html, video, start_s, end_s, made)
    if rerun is None:
        tell(made, as_json)
    elif web:
        _serve(rerun, made, show, as_json)
    else:
        from nathlon.reports.replay import open_viewer

        tell(made, as_json)
        if show:
            open_viewer(rerun)


def _make_film(path: Path, video: Path | None, made: dict[str, Any]) -> Path | None:
    """What is wanted of an episode's recording: noted in `made`; the Rerun replay, if it is that."""
    from nathlon.arena.film_recording import read_film

    film = read_film(path)
    if video:
        if video.suffix != ".webm":
            raise InputError(f"{video}: videos of episodes are WebM, expected a name that ends in .webm")
        need("av", "video", "a video")
        from nathlon.reports.film_video import write_film_video

        made["video"] = _written(video, lambda: write_film_video(film, video))
        return None
    rerun = made["replay"] = path.with_suffix(".rrd")
    check_output(rerun, is_file=True)
    from nathlon.reports.film_replay import write_film_replay

    return _written(rerun, lambda: write_film_replay(film, rerun))


def _make_race(
    path: Path,
    car: str | None,
    html: Path | None,
    video: Path | None,
    start_s: float | None,
    end_s: float | None,
    made: dict[str, Any],
) -> Path | None:
    """What is wanted of a race's recording: noted in `made`; the Rerun replay, if it is that."""
    from nathlon.arena.recording import read_recording
    from nathlon.reports.cars import car_index

    log = read_recording(path)
    follow = None if car is None else car_index(log, car, path)
    if html:
        from nathlon.reports.player import write_player

        made["page"] = _written(html, lambda: write_player(log, html, follow))
    if video:
        need("av", "video", "a video")
        from nathlon.reports.video import write_video

        made["video"] = _written(video, lambda: write_video(log, video, follow, start_s, end_s))
    if html or video:
        return None
    rerun = made["replay"] = path.with_suffix(".rrd")
    check_output(rerun, is_file=True)
    from nathlon.reports.replay import write_replay

    return _written(rerun, lambda: write_replay(log, rerun, follow))


def _recover(recording: Path, as_json: bool) -> None:
    """Write what can be read of a damaged recording beside it."""
    from nathlon.arena.recording import recover_recording, write_recording

    found = recover_recording(recording)
    path = recording.with_suffix(f".recovered{recording.suffix}")
    until_s = float(found.log.time_s[-1])
    made = {"recording": _written(path, lambda: write_recording(path, found.log)), "messages": found.messages}
    if as_json:
        print_json({**made, "until_s": until_s, "whole": found.whole})
        return
    tell(made, as_json)
    lost = "nothing was missing" if found.whole else "what came after cannot be read"
    say(f"The race until {until_s:.1f} s; {lost}")


def _written(path: Path, write: Callable[[], object]) -> Path:
    """The path, once it has been written."""
    with writing(path):
        write()
    return path


def _serve(rerun: Path, made: dict[str, Any], show: bool, as_json: bool) -> None:
    """Serve a replay to browsers on this machine until Ctrl-C."""
    from nathlon.reports.web_viewer import WebViewer

    with WebViewer(rerun) as viewer:
        tell({**made, "viewer": viewer.url}, as_json)
        warn("Ctrl-C ends it.")
        if show:
            webbrowser.open(viewer.url)
        try:
            viewer.serve_forever()
        except KeyboardInterrupt:
            warn("Stopped.")
