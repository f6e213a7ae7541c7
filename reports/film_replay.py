"""A film as a Rerun recording with its own layout."""

from __future__ import annotations

from pathlib import Path

import numpy as np
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
    view = rrb.Spatial2DView(origin="pictures", name=f"{film.scenario}: {_who(film)}")
    stream.send_blueprint(
        rrb.Blueprint(view, rrb.TimePanel(timeline=TIMELINE, state="collapsed"), collapse_panels=True),
        make_active=False,
    )
    pictures = rr.EncodedImage.columns(
        blob=list(film.pictures), media_type=["image/jpeg"] * len(film.pictures)
    )
    stream.send_columns("pictures", [rr.TimeColumn(TIMELINE, duration=np.array(film.time_s))], pictures)
    content = written.read()
    stream.disconnect()
    with whole_file(path) as partial:
        partial.write_bytes(content or b"")


def _who(film: Film) -> str:
    """Who had which seats."""
    seats: dict[str, list[str]] = {}
    for seat, who in film.seats:
        seats.setdefault(who, []).append(seat)
    return "; ".join(f"{who} ({', '.join(taken)})" for who, taken in seats.items())
