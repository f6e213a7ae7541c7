"""Commands that a report prints: typed into a shell in the folder above its page, they do what they say."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from nathlon.arena.entrant import enter, entrants_table
from nathlon.arena.match import Match, Race, Seat
from nathlon.arena.match_policies import match_policies
from nathlon.arena.recording import read_recording, write_recording
from nathlon.arena.runner import run_match
from nathlon.arena.store import Store
from nathlon.reports.page import write_page
from nathlon.results.summary import Replay
from nathlon.selection.publish.gathering import gather
from nathlon.selection.publish.output import OutputFolder
from nathlon.selection.publish.replays import record_stored_race
from tests.support.checkpoints import BUNDLED
from tests.support.command_line import nathlon
from tests.support.opened_page import overhear, until

FOLDER = "Ändern & 'fahren'"
STORE = "../alle Nächte.sqlite"
RACER = next(path for path in BUNDLED if path.stem == "lindenring-again-056k")
SCENARIO = """
name = "dash"
description = ""
cars = 4
rules = "sporting"
time_s = 9.0
start = {kind = "grid"}
"""


@pytest.fixture(scope="module")
def raced(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder of a night in which one race was raced and recorded, and where its page shows it."""
    folder = tmp_path_factory.mktemp("hints") / FOLDER / "Nacht 1"
    output = OutputFolder(folder)
    scenario = folder / "dash.toml"
    scenario.write_text(SCENARIO)
    seats = [tuple(Seat((car + first) % 2, (car + first) % 2) for car in range(4)) for first in (0, 1)]
    entrants = [enter(source, "lindenring", "gt3") for source in (str(RACER), "driver:pace=0.8")]
    ids, sources = (tuple(getattr(one, name) for one in entrants) for name in ("id", "source"))
    match = Match(
        "tournament", "2v2", str(scenario), "lindenring", "gt3", ids, sources,
        tuple(Race(7, places) for places in seats),
    )  # fmt: skip
    with Store(folder / STORE) as store:
        store.begin_run("night", {})
        store.put_table("night", "entrants", entrants_table(entrants))
        store.add_match(match.key, "tournament", match.spec(), run_match(match, match_policies(match)))
        store.use("night", [match.key])
        recording = record_stored_race(store, f"{match.key}:1", output.races)
        selection = gather(store, "night")
    log = read_recording(recording)
    incident = replace(log.incidents[0], kind="contact", time_s=6.0, cars=(2, 3), fault=2)
    log = replace(log, incidents=(incident,))
    write_recording(recording, log)
    shown = Replay(match=match.key, race=1, why="the only one", recording=f"../races/{recording.name}")
    selection = replace(
        selection,
        store=output.named(selection.store),
        summary=selection.summary.model_copy(update={"replays": (shown,)}),
        logs=(log,),
    )
    write_page(selection, output.report)
    return folder, f"#/race/{match.key[:12]}/1"


def test_commands_of_a_race_do_what_they_say(browser: Browser, raced: tuple[Path, str]) -> None:
    folder, address = raced
    page = browser.new_page()
    overhear(page)
    page.goto(next((folder / "report").glob("*.html")).as_uri() + address)
    until(page, "document.querySelector('#incidents')")
    for name in ("race it again", "Make a test"):
        page.get_by_role("button", name=name).click()
    commands = [shlex.split(text) for text in page.locator("pre code").all_inner_texts()]
    page.close()
    assert sorted(words[1] for words in commands) == ["incident", "replay", "replay", "twin"]
    for program, *words in commands:
        assert program == "nathlon"
        meant = ["driver" if word == "FILE" else "again" if word == "NAME" else word for word in words]
        done = nathlon(*meant, *(["--no-open"] if words[0] == "replay" else []), cwd=folder)
        assert done.returncode == 0, (words, done.stderr)
