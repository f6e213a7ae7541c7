"""The report of a selection in another world, with its videos."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser

import nathlon
from nathlon.api.selection import SelectionResult
from tests.support.games import player, world_of
from tests.support.opened_page import overhear, visit

SETTINGS = """
[pareto]
races = 2
most_races = 2
keep_probability = 0.0
[battery]
runs = 4
[tournament]
pairs = 6
block = 3
"""
OF_CARS = re.compile(
    r"\b(laps?|m/s|km|cars?|grid|circuit|overtak\w*|wheel\w*|penalt\w*|contacts?|race[srd]?|episodes?)\b",
    re.IGNORECASE,
)
"""What a game of lights, played in bouts, has none of."""


@pytest.fixture(scope="module")
def duel(tmp_path_factory: pytest.TempPathFactory) -> SelectionResult:
    folder = tmp_path_factory.mktemp("duel")
    players = [
        player(folder / f"{name}.onnx", right) for name, right in (("all", 3), ("two", 2), ("none", 0))
    ]
    (folder / "nathlon.toml").write_text(SETTINGS)
    measures = "{'hits': Declared('hits', unit='lights')}"
    options = f"measures={measures}, episode='bout', step_s=0.25"
    name = world_of(folder, f"PettingZooWorld({{'duel': envs['seen']}}, {options})", "lights.py")
    return nathlon.select(
        players, folder / "out", config=folder / "nathlon.toml", workers=1, world=name, progress=False
    )


def test_it_tells_of_the_world_s_own_things_and_plays_its_videos(
    browser: Browser, duel: SelectionResult
) -> None:
    page = browser.new_page()
    requests, complaints = overhear(page)
    page.goto(duel.report.as_uri())
    assert page.locator("h1").inner_text() == "Send all"
    links = {a.inner_text(): a.get_attribute("href") for a in page.locator("section a").all()}
    first, second = duel.summary.replays
    assert links["video"] == second.video
    assert (duel.report.parent / str(links["recording, for Foxglove and Rerun"])).is_file()

    seen = [page.locator("main").inner_text()]
    for view, table, rows in (
        ("leaderboard", "leaderboard", 3),
        ("pareto", "pareto", 3),
        ("n-athlon", "n-athlon", 3),
        ("matchups", "matchups", 3),
        ("committee", "", 0),
        (f"checkpoint/{duel.ranking['entrant'][0][:12]}", "own-races", 1),
        (f"race/{first.match[:12]}/{first.race}", "result", 2),
    ):
        visit(page, f"#/{view}")
        if table:
            assert page.locator(f"#{table} tbody tr").count() >= rows, view
        seen.append(page.locator("main").inner_text())
    assert "mean score a bout played" in seen[1].lower()
    assert "won, %" in seen[1].lower()
    assert "Hits, lights" in seen[2]
    assert "left: " in seen[-1]
    assert "right: " in seen[-1]
    # Names of files say what they are called.
    for text in seen:
        found = OF_CARS.search(re.sub(r"\S*races/\S*", "", text))
        assert found is None, text[found.start() - 60 : found.end() + 30]

    video = page.locator("video")
    played = video.evaluate(
        """video => new Promise(resolve => {
            const tell = () => resolve([video.readyState, video.duration, video.videoWidth]);
            video.readyState >= 2 ? tell() : video.addEventListener("loadeddata", tell);
            video.addEventListener("error", () => resolve(["error", 0, 0]));
        })"""
    )
    assert played[0] >= 2
    assert played[1] == pytest.approx(6 * 0.25 + 1.0, abs=0.1)
    assert played[2] == 122
    assert complaints == []
    own = duel.report.as_uri()
    asked = {url.partition("#")[0] for url in requests} - {own, "data:,"}
    assert asked == {(duel.folder / "replays" / Path(str(first.video)).name).absolute().as_uri()}
    page.close()
