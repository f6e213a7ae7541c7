"""The player: a race as one web page that plays without a network and without a graphics card."""

from __future__ import annotations

from pathlib import Path

from nathlon.arena.race_log import RaceLog
from nathlon.reports.cars import winner
from nathlon.reports.race_data import circuit_data, race_data
from nathlon.reports.self_contained import render_page, script_data, template_text, write_page_file

SPACE = tuple(
    f"scene3d/{part}.js"
    for part in (
        "cameras",
        "shapes",
        "circuit",
        "car_models",
        "landscape",
        "effects",
        "cockpit",
        "shaders",
        "view",
    )
)
"""Scripts that draw cars on a circuit in three dimensions; test drives have them too."""
PARTS = ("element", "recording", "scene", "battle", "trackside", "space", "watching", "player", "order")
"""Scripts in templates/race of which the player is made, in their order; the report has them too."""


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
        [f'"use strict";\n\n{player_script()}\n{template_text("player_page.js")}'],
        log=log,
        race=script_data(race),
    )


def player_script() -> str:
    """The player itself, for whichever page it stands in."""
    return template_text(*SPACE, *(f"race/{part}.js" for part in PARTS))


def player_style() -> str:
    """How the player looks, in the colours of the page that it stands in."""
    return template_text("race/player.css")
