"""`nathlon replay`."""

from __future__ import annotations

import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any

from nathlon.arena.race_log import RaceLog
from nathlon.arena.recording import read_recording, recover_recording, write_recording
from nathlon.arena.store import Store
from nathlon.commands.console import print_json, say, tell, warn
from nathlon.replays import record_stored_race
from nathlon.reports.cars import labels
from nathlon.reports.player import write_player
from nathlon.reports.replay import open_viewer, write_replay
from nathlon.reports.web_viewer import WebViewer
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need


def replay(
    source: str,
    race: str | None,
    car: str | None,
    out: Path,
    show: bool,
    web: bool,
    html: Path | None,
    video: Path | None,
    start_s: float | None,
    end_s: float | None,
    as_json: bool = False,
) -> None:
    """Show a race: in Rerun's viewer, in the browser, or as the page or the video asked for.

    Args:
        source: a recording; with `race`, a store.
        race: of the store, run again and recorded in the folder `out`.
        car: to follow, by name or number.
        out: folder for what is run again.
        show: open a viewer.
        web: in the browser.
        html, video: files to write in place of a Rerun replay.
        start_s, end_s: of the video, in the race.
        as_json: print JSON.
    """
    path, made = Path(source), dict[str, Any]()
    if race is not None:
        with Store.open(source) as store:
            path = made["recording"] = record_stored_race(store, race, out)
    log = read_recording(path)
    follow = None if car is None else car_index(log, car, path)
    if html:
        made["page"] = _written(html, lambda: write_player(log, html, follow))
    if video:
        need("av", "video", "a video")
        from nathlon.reports.video import write_video

        made["video"] = _written(video, lambda: write_video(log, video, follow, start_s, end_s))
    if html or video:
        tell(made, as_json)
        return
    rerun = path.with_suffix(".rrd")
    made["replay"] = _written(rerun, lambda: write_replay(log, rerun, follow))
    if web:
        _serve(rerun, made, show, as_json)
        return
    tell(made, as_json)
    if show:
        open_viewer(rerun)


def recover(recording: Path, as_json: bool = False) -> None:
    """Write what can be read of a damaged recording beside it."""
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


def car_index(log: RaceLog, car: str, path: Path) -> int:
    """The car with this number or name; the best placed one of several with the same name.

    Raises:
        InputError: if there is none.
    """
    numbers = range(len(log.names))
    if car.isdecimal() and int(car) in numbers:
        return int(car)
    named = [number for number in numbers if car in (log.names[number], labels(log)[number])]
    if not named:
        raise InputError(
            f"{path}: there is no car {car!r}, expected a number from 0 to {len(numbers) - 1} "
            f"or one of {', '.join(dict.fromkeys(log.names))}"
        )
    return min(named, key=lambda number: log.samples["place"][-1, number]) if len(log.time_s) else named[0]


def _written(path: Path, write: Callable[[], object]) -> Path:
    """The path, once it has been written."""
    try:
        write()
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    return path


def _serve(rerun: Path, made: dict[str, Any], show: bool, as_json: bool) -> None:
    """Serve a replay to browsers on this machine until Ctrl-C."""
    with WebViewer(rerun) as viewer:
        tell({**made, "viewer": viewer.url}, as_json)
        warn("Ctrl-C ends it.")
        if show:
            webbrowser.open(viewer.url)
        try:
            viewer.serve_forever()
        except KeyboardInterrupt:
            warn("Stopped.")
