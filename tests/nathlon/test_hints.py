"""Commands that others print as hints: typed into a shell as they stand, they do what they say."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from nathlon.api.selection import SelectionResult
from nathlon.arena.recording import read_recording, write_recording
from nathlon.arena.store import Store
from nathlon.selection.committee.event_log import EventLog
from nathlon.sim.errors import InputError
from tests.support.command_line import nathlon
from tests.support.committees import ALONE, RUN, ask
from tests.support.race_logs import oval_race

FOLDER = "Ändern & 'fahren'"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / FOLDER).mkdir()
    return tmp_path / FOLDER


def hint(said: str, label: str) -> list[str]:
    """The words that a shell makes of the command of a line, without the first."""
    [line] = [line for line in said.splitlines() if line.startswith(label)]
    program, *words = shlex.split(line.removeprefix(label))
    assert program == "nathlon"
    return words


def test_what_is_generated_can_be_looked_at(folder: Path, tmp_path: Path) -> None:
    made = nathlon("car", "generate", "--seed", "2", "--out", FOLDER, cwd=tmp_path).stdout
    assert nathlon(*hint(made, "Check"), cwd=tmp_path).returncode == 0
    assert (tmp_path / hint(made, "Race")[-1]).is_file()
    laid = ("--seed", "4", "--style", "national", "--length", "2000")
    made = nathlon("track", "generate", *laid, "--out", FOLDER, cwd=tmp_path).stdout
    assert nathlon(*hint(made, "Map"), "--out", "map.png", cwd=tmp_path).returncode == 0
    assert (tmp_path / hint(made, "Race")[-1]).exists()


def test_a_configuration_is_where_its_command_looks(folder: Path, tmp_path: Path) -> None:
    made = nathlon("init", f"{FOLDER}/a b.toml", cwd=tmp_path).stdout
    assert (tmp_path / hint(made, "Command")[-1]).is_file()


def test_a_damaged_recording_is_saved_by_the_command_that_says_so(folder: Path, tmp_path: Path) -> None:
    path = folder / "race.mcap"
    write_recording(path, oval_race(cars=2, duration_s=5.0))
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError) as refusal:
        read_recording(path)
    words = shlex.split(str(refusal.value).partition("(nathlon ")[2].partition(" saves what")[0])
    assert nathlon(*words, cwd=tmp_path).returncode == 0
    assert list(folder.glob("race.recovered.mcap"))


def test_a_committee_that_is_waited_for_is_asked_by_its_command(folder: Path, tmp_path: Path) -> None:
    store = folder / "store.sqlite"
    with Store(store) as opened:
        opened.begin_run(RUN, {})
        ask(EventLog(opened, RUN), ALONE)
    waits = repr(SelectionResult(folder, None, str(store)))
    done = nathlon(*hint(waits, "The committee waits for its members:"), cwd=tmp_path)
    assert done.returncode == 0
    assert "birch" in done.stdout
