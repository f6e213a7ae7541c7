"""A film as a Rerun recording with its own layout."""

from __future__ import annotations

from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from nathlon.arena.film import Film
from nathlon.sim.whole_file import whole_file

TIMELINE = "episode_time"


def write_film_replay(film: Film, path: Path) -> None:
    """Write a film as .rrd; a file of that name is replaced whole."""
    stream = rr.RecordingStream("nathlon", recording_id=f"{film.match}-{film.race}", send_properties=False)
    # To a file, Rerun writes from a thread that waits for ever once the disk is full.
    written = rr.binary_stream(stream)
    seats = ", ".join(f"{seat}: {who}" for seat, who in film.seats)
    view = rrb.Spatial2DView(origin="pictures", name=f"{film.scenario}, {seats}")
    stream.send_blueprint(
        rrb.Blueprint(view, rrb.TimePanel(timeline=TIMELINE, state="collapsed"), collapse_panels=True),
        make_active=False,
    )
    for time_s, picture in zip(film.time_s, film.pictures, strict=True):
        stream.set_time(TIMELINE, duration=time_s)
        stream.log("pictures", rr.EncodedImage(contents=picture, media_type="image/jpeg"))
    content = written.read()
    stream.disconnect()
    with whole_file(path) as partial:
        partial.write_bytes(content or b"")
