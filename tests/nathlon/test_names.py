"""Names are names, whatever is in them, in everything that a selection shows and leaves."""

from __future__ import annotations

import csv
import logging
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import openpyxl
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from playwright.sync_api import Browser

from nathlon.api.selection import SelectionResult
from nathlon.arena.race_log import RaceLog
from nathlon.arena.recording import read_recording, write_recording
from nathlon.commands.selection import print_places, print_verdict
from nathlon.policies.sources import driver_settings
from nathlon.reports.ablation import ABLATION, EFFECTS, write_ablation
from nathlon.reports.player import render_player
from nathlon.reports.replay import race_sheet, write_replay
from nathlon.reports.spreadsheet import write_spreadsheet
from nathlon.reports.tables import as_texts, write_tables
from nathlon.reports.video import pictures
from nathlon.results.selection import Selection
from nathlon.results.standing import ranked
from nathlon.results.summary import Sent
from nathlon.sim.data_file import DATA
from nathlon.sim.errors import InputError
from nathlon.sim.names import LONGEST, as_named, file_stem, printable, proper_name, written
from nathlon.sim.scenario import load_scenario
from nathlon.terminal import progress, say, warn
from nathlon.terminal.progress import progress_bars
from tests.nathlon.test_nightly import EVENT, SMALL
from tests.support.checkpoints import BUNDLED
from tests.support.command_line import nathlon
from tests.support.opened_page import Opened, key
from tests.support.race_logs import oval_race
from tests.support.selections import build

HOSTILE = (
    "a[/red]b",
    "$x_{",
    "=1+1",
    "</script><script>",
    ":smile:",
    "x\ny",
    "\x1b[2J\x07\u202ednal\x00",
    "[bold]|![x](https://example.org/x.png)*_`<!--",
    "../" * 90,
)
NAMES = tuple(map(proper_name, HOSTILE))
CONTROLS = set(map(chr, [*range(10), *range(11, 32), 127, 0x202E]))


def hostile() -> Selection:
    """A selection in which everybody has such a name."""
    selection = build(np.random.default_rng(0), entrants=40, finalists=6)
    cards = selection.tables["entrants"]
    names = {
        entrant: f"{NAMES[i % len(NAMES)]}{' ' * (i // len(NAMES))}"
        for i, entrant in enumerate(cards["entrant"])
    }
    final = selection.tables["ranking"]["entrant"]
    names |= dict(zip(final, NAMES, strict=False))
    named = {
        **selection.tables,
        "entrants": cards.with_columns(name=pl.col("entrant").replace_strict(names)),
    }
    facts = {
        "ranking": ranked(selection.tables["ranking"], names),
        "sent": (Sent(name=NAMES[0], entrant=final[0]),),
    }
    return replace(
        selection, title=NAMES[3], tables=named, summary=selection.summary.model_copy(update=facts)
    )


def hostile_race(names: tuple[str, ...] = NAMES[:8]) -> RaceLog:
    return replace(oval_race(duration_s=4.0), names=names, circuit=names[1], scenario=names[4])


@pytest.mark.parametrize(
    "text", ["Ä b-ç.7", "driver:pace=0.9", "夜の走り", "a\u00a0b".replace("\u00a0", " ")]
)
def test_an_ordinary_name_stays_as_it_is(text: str) -> None:
    assert printable(text) == proper_name(text) == text


@given(st.text(st.characters(exclude_categories=())))
def test_a_name_is_one_printable_line_of_bounded_length(text: str) -> None:
    name = proper_name(text)
    assert name.isprintable()
    assert len(name) <= LONGEST
    assert proper_name(name) == name
    name.encode()


def test_what_cannot_be_printed_is_written_out() -> None:
    assert printable("x\ny\x1b[2J\u202e\udcff") == r"x\ny\x1b[2J\u202e\udcff"
    long = "a" * 200 + "-1"
    assert proper_name(long).endswith("aaa-1")
    assert proper_name(long) != proper_name("a" * 200 + "-2")


@given(st.text(st.characters(exclude_categories=())))
def test_a_file_name_stays_in_its_folder_and_can_be_made(text: str) -> None:
    stem = file_stem(text)
    assert Path(stem).name == stem
    assert not stem.startswith(("-", "."))
    assert stem.isprintable()
    assert len(f"{stem}.png".encode()) < 210
    assert file_stem("Porto Sereno.2") == "Porto-Sereno.2"


def test_the_console_prints_names_as_they_are(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    print_verdict(hostile().summary)
    print_places(SelectionResult(tmp_path, hostile()))
    for name in HOSTILE[:8]:
        say(f"said {name}")
        warn(f"warned {name}")
    said = capsys.readouterr()
    for name in NAMES[:6]:
        assert f" {name} " in said.out
    for name in NAMES[:8]:
        assert f"said {name}\n" in said.out
        assert f"warned {name}\n" in said.err
    assert CONTROLS.isdisjoint(said.out + said.err)
    assert "Sent         a[/red]b\n" in said.out


@pytest.mark.parametrize("name", HOSTILE[:5])
def test_progress_shows_names_as_they_are(capsys: pytest.CaptureFixture[str], name: str) -> None:
    with progress_bars() as bars:
        bars.add_task(name, total=1, note=f"note {name}", completed=1)
    said = capsys.readouterr().err
    assert f"{name:<12}" in said
    assert f"note {name}" in said


def test_errors_and_warnings_are_one_line(tmp_path: Path) -> None:
    done = nathlon("race", "\x1b[31m[/red]:smile:\n.safetensors", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(r"nathlon: \x1b[31m[/red]:smile:\n.safetensors: ")
    assert done.stderr.count("\n") == 1
    record = logging.LogRecord("arena", logging.WARNING, "", 1, "%s is out", ("x\ny\x1b",), None)
    assert logging.lastResort is not None
    assert logging.lastResort.format(record) == r"x\ny\x1b is out"


def test_the_page_shows_names_as_they_are(browser: Browser, tmp_path: Path) -> None:
    selection = hostile()
    opened = Opened(browser, selection, tmp_path)
    assert opened.page.title() == NAMES[3]
    opened.go("#/leaderboard")
    assert set(opened.names("leaderboard")) == set(NAMES[:6])
    for place in range(3):
        opened.go(f"#/checkpoint/{key(selection, place)}")
        assert opened.page.locator("h1").inner_text() == NAMES[place]
    opened.assert_quiet()


def test_spreadsheet_and_tables_hold_names_as_they_are(tmp_path: Path) -> None:
    selection = hostile()
    book = openpyxl.load_workbook(write_spreadsheet(selection, tmp_path / "ranking.xlsx"))
    cells = [cell for row in book["Ranking"].iter_rows() for cell in row]
    assert set(NAMES[:6]) <= {cell.value for cell in cells}
    assert not [cell.value for cell in cells if cell.data_type == "f" or cell.hyperlink]
    write_tables(selection, tmp_path)
    written = pl.read_parquet(tmp_path / "entrants.parquet")
    assert written.equals(selection.tables["entrants"])


def test_no_cell_of_a_csv_file_is_a_formula(tmp_path: Path) -> None:
    texts = ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1", "'=1", "' ", "a=1", "", None, 'q",=1']
    selection = hostile()
    cards = (
        selection.tables["entrants"]
        .head(len(texts))
        .with_columns(name=pl.Series(texts), step=pl.Series([-1, *range(11)]))
    )
    write_tables(replace(selection, tables={**selection.tables, "entrants": cards}), tmp_path)
    with (tmp_path / "entrants.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert not [row["name"] for row in rows if row["name"].startswith(tuple("=+-@\t\r"))]
    assert [row["name"].removeprefix("'") for row in rows] == [text or "" for text in texts]
    assert rows[0]["step"] == "-1"
    for one, other in zip(rows, as_texts(cards)["name"], strict=True):
        assert one["name"] == (other or "")
    assert pl.read_parquet(tmp_path / "entrants.parquet").equals(cards)


def test_a_replay_shows_names_as_they_are(tmp_path: Path) -> None:
    log = hostile_race()
    write_recording(tmp_path / "race.mcap", log)
    read = read_recording(tmp_path / "race.mcap")
    assert (read.names, read.circuit) == (log.names, log.circuit)
    write_replay(log, tmp_path / "race.rrd")
    assert "</script><script>" not in render_player(log)
    tokens = MarkdownIt("commonmark").enable("table").parse(race_sheet(log))
    cells = [token for token in tokens if token.type == "inline"]
    assert [
        token.type
        for cell in cells
        for token in cell.children or ()
        if token.type not in ("text", "text_special")
    ] == []
    shown = {cell.content and "".join(token.content for token in cell.children or ()) for cell in cells}
    assert {f"{car} {name}" for car, name in enumerate(log.names, 1)} <= shown
    assert log.circuit in shown


def test_a_video_of_a_foreign_recording_shows_whatever_its_names_are() -> None:
    [picture] = pictures(hostile_race(HOSTILE[:8]), 6, np.array([1.0]))
    assert picture.any()


def test_figures_show_names_as_they_are(tmp_path: Path) -> None:
    rows = [
        {"variant": name, "seed": 1, "updates": 1000 * step, "lap_s": 90.0 + step, "off_course_share": 0.1}
        for name in ("base", *NAMES[:6])
        for step in (1, 2)
    ]
    write_ablation(pl.DataFrame(rows, schema=ABLATION), pl.DataFrame(schema=EFFECTS), tmp_path)
    assert (tmp_path / "ablation.png").stat().st_size > 1000


def test_a_circuit_with_such_names_is_drawn(tmp_path: Path) -> None:
    folder = tmp_path / "circuit"
    shutil.copytree(DATA / "circuits" / "lindenring", folder)
    toml = folder / "circuit.toml"
    text = toml.read_text("utf-8")
    own = next(line for line in text.splitlines() if line.startswith("name = "))
    sections = [line for line in text.splitlines() if line.startswith("name = ")][1:3]
    text = text.replace(own, r'name = "../$x_{\u0000\n[/red]:smile:"', 1)
    text = text.replace(sections[0], 'name = "$y^{"', 1).replace(sections[1], 'name = "[/bold]"', 1)
    toml.write_text(text, "utf-8")
    done = nathlon("track", "show", str(toml), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "[/bold]" in done.stdout
    assert [path.name for path in tmp_path.glob("*.png")] == ["x_-x00-n-red-smile.png"]
    assert CONTROLS.isdisjoint(done.stdout)


def test_an_evaluation_of_composites_with_such_names_comes_to_its_end(tmp_path: Path) -> None:
    (tmp_path / "nathlon.toml").write_text(SMALL)
    (tmp_path / "event.toml").write_text(EVENT)
    names = ("a[/red]b", "=1+1 $x_{")
    for number, name in enumerate(names):
        # Both drive alike, so that the filter keeps both.
        parts = (number + 1) * f'[[part]]\npolicy = "{BUNDLED[-1]}"\n'
        (tmp_path / f"{number}.toml").write_text(f"name = '{name}'\n{parts}")
    command = ("evaluate", "0.toml", "1.toml", "--config", "nathlon.toml", "--out", "out", "--workers", "1")
    done = nathlon(*command, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert [name for name in names if name in done.stdout] == list(names)
    ranked = pl.read_csv(tmp_path / "out" / "report" / "tables" / "entrants.csv")["name"].to_list()
    assert set(ranked) == {"a[/red]b", "'=1+1 $x_{"}


@given(st.lists(st.sampled_from(["a", "\\", "\\udc80", "\\x5c", "x5c", "udcff", "\udc80", "\udcff", "é"])))
def test_a_path_is_written_in_utf8_and_found_again(parts: list[str]) -> None:
    path = "".join(parts)
    assert as_named(written(path)) == path
    written(path).encode()


@pytest.mark.parametrize(
    ("read", "name", "setting"),
    [(load_scenario, "race:laps=1,cars=2,laps=2", "laps"), (driver_settings, "driver:lane=1,lane=2", "lane")],
)
def test_a_setting_that_is_given_twice_is_refused(
    read: Callable[[str], object], name: str, setting: str
) -> None:
    with pytest.raises(InputError, match=f"setting {setting} is given 2 times, expected it once"):
        read(name)


def test_a_stage_that_takes_long_has_a_line_a_minute(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = 0.0
    monkeypatch.setattr("nathlon.terminal.progress.time.monotonic", lambda: now)
    with progress.stage_progress(True, ("worker",)) as on_match:
        for now in (0.0, 50.0, 70.0, 100.0, 140.0):
            on_match("worker", int(now), int(now))
    assert capsys.readouterr().err.splitlines() == [
        "Worker       70 matches after 70 s",
        "Worker       140 matches after 140 s",
        "Worker       140 matches in 140 s",
    ]
