"""What commands print in terminals of different widths, and in a pipe."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from rich.cells import cell_len

from nathlon.arena.store import Store
from nathlon.selection.committee.event_log import EventLog
from nathlon.terminal import console, new_table, print_table, say, tell
from nathlon.terminal.progress import busy
from tests.support.command_line import nathlon
from tests.support.committees import NAMES, PEOPLE, RUN, ask

STYLES = re.compile(r"\x1b\[[0-9;]*m")
WIDE = {f"Head {number}": f"{number}.25 (0.12 to 9.87)" for number in range(6)}


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    """Consoles ask for the width of the terminal as they are made."""
    console.cache_clear()
    yield
    console.cache_clear()


def terminal(monkeypatch: pytest.MonkeyPatch, width: int) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", str(width))


def wide_table() -> None:
    table = new_table("Wide", ("Entrant", *WIDE))
    table.add_row("amber", *WIDE.values())
    print_table(table)


@pytest.mark.parametrize("width", [40, 80, 120])
def test_a_table_that_is_too_wide_is_a_list_with_all_its_figures(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], width: int
) -> None:
    terminal(monkeypatch, width)
    wide_table()
    title, name, *lines = STYLES.sub("", capsys.readouterr().out).splitlines()
    assert (title, name) == ("Wide", "amber")
    assert max(map(len, lines)) <= width
    assert [figure for line in lines for figure in line.strip().split("   ")] == [
        f"{head} {cell}" for head, cell in WIDE.items()
    ]


@pytest.mark.parametrize("shown", [True, False])
def test_what_cannot_be_counted_shows_that_it_goes_on_where_somebody_looks(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], shown: bool
) -> None:
    with busy("Racing [bold]", shown):
        pass
    assert capsys.readouterr() == ("", "")
    console.cache_clear()
    terminal(monkeypatch, 80)
    with busy("Racing [bold]", shown):
        pass
    printed = capsys.readouterr()
    assert ("Racing [bold]" in STYLES.sub("", printed.err)) == shown
    assert printed.out == ""


def test_in_a_pipe_a_table_stays_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    wide_table()
    [row] = [line for line in capsys.readouterr().out.splitlines() if "amber" in line]
    assert all(cell in row for cell in WIDE.values())


def test_prose_goes_on_below_itself_between_words(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    terminal(monkeypatch, 40)
    path = "/".join(["a-folder-with-a-long-name"] * 3)
    say(f"Note         what is said here is longer than the terminal is wide 好好好好好好好好好好 {path}")
    first, *others = capsys.readouterr().out.splitlines()
    assert first.startswith("Note         what is said")
    assert all(line.startswith(" " * 13) for line in others)
    assert all(cell_len(line) <= 40 for line in (first, *others[:-1]))
    assert others[-1].strip() == path
    tell({"replay": f"nathlon replay '{path} 1.mcap' --web"}, False)
    assert capsys.readouterr().out == f"Replay       nathlon replay '{path} 1.mcap' --web\n"


@pytest.mark.parametrize("width", [80, 120])
def test_no_command_is_wider_than_the_terminal(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, width: int
) -> None:
    terminal(monkeypatch, width)
    with Store(tmp_path / "store.sqlite") as store:
        store.begin_run(RUN, {})
        ask(EventLog(store, RUN), PEOPLE)
    for words in (
        ("committee", "store.sqlite", "show"),
        ("committee", "store.sqlite", "log"),
        ("track", "show", "lindenring", "--out", "map.png"),
        ("car", "check", "gt3"),
        ("world", "list"),
    ):
        printed = STYLES.sub("", nathlon(*words, cwd=tmp_path).stdout)
        assert max(map(cell_len, printed.splitlines())) <= width, printed
        assert words[0] != "committee" or all(name in printed for name in NAMES)
        if words[-1] == "show" and words[0] == "committee":
            told = " ".join(printed.split())
            assert "* would be chosen as it stands: first of those that are fit" in told
            assert "Figures are of the n-athlon." in told
            # A table where there is room, and then with the heads in one column.
            assert ("Contacts At fault Off" in told) == (width == 120)
