"""The player: a race as one web page that plays without a network and without a graphics card."""

from __future__ import annotations

from pathlib import Path

from nathlon.arena.race_log import RaceLog
from nathlon.reports.cars import winner
from nathlon.reports.race_data import circuit_data, race_data
from nathlon.reports.self_contained import render_page, script_data, template_text, write_page_file


def write_player(log: RaceLog, path: Path, follow: int | None = None) -> None:
    """Write the page, at first with the camera on car `follow` (the winner if None), whole or not at all."""
    write_page_file(render_player(log, follow), path)


def render_player(log: RaceLog, follow: int | None = None) -> str:
    """The page's HTML. Its policy admits only the style and the script written here, by their hashes."""
    race = {
        "race": race_data(log),
        "circuit": circuit_data(log.outline, log.sections),
        "followed": winner(log) if follow is None else follow,
    }
    return render_page(
        "player.html",
        player_style() + template_text("player_page.css"),
        "player_page.js",
        log=log,
        race=script_data(race),
    )


def player_style() -> str:
    """How the player looks, in the colours of the page that it stands in."""
    return template_text("race/player.css")
