"""A film as a Rerun recording with its own layout."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from nathlon.arena.film import Film
from nathlon.reports._rerun_file import rerun_file

TIMELINE = "episode_time"


def write_film_replay(film: Film, path: Path) -> None:
    """Write a film as .rrd; a file of that name is replaced whole."""
    name = f"{film.scenario}: {_who(film)}"
    layout = rrb.Blueprint(
        rrb.Spatial2DView(origin="pictures", name=name),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )
    pictures = rr.EncodedImage.columns(
        blob=list(film.pictures), media_type=["image/jpeg"] * len(film.pictures)
    )
    with rerun_file(path, f"{film.match}-{film.race}", name, layout) as stream:
        stream.send_columns("pictures", [rr.TimeColumn(TIMELINE, duration=np.array(film.time_s))], pictures)


def _who(film: Film) -> str:
    """Who had which seats."""
    seats: dict[str, list[str]] = {}
    for seat, who in film.seats:
        seats.setdefault(who, []).append(seat)
    return "; ".join(f"{who} ({', '.join(taken)})" for who, taken in seats.items())
