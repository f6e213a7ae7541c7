"""A disk that is full is told in a sentence, and leaves no half of a file."""

from __future__ import annotations

import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from nathlon.arena.recording import write_recording
from nathlon.reports.page import write_page
from nathlon.reports.player import write_player
from nathlon.reports.replay import write_replay
from nathlon.reports.spreadsheet import write_spreadsheet
from nathlon.reports.tables import write_tables
from nathlon.results.summary import read_summary, write_summary
from nathlon.selection.publish.output import OutputFolder
from nathlon.sim.errors import InputError
from tests.support.race_logs import oval_race
from tests.support.selections import build

LOG = oval_race(cars=4, duration_s=20.0)
SELECTION = build(np.random.default_rng(1))
WRITERS: dict[str, Callable[[Path], object]] = {
    "race.mcap": lambda folder: write_recording(folder / "race.mcap", LOG),
    "race.rrd": lambda folder: write_replay(LOG, folder / "race.rrd"),
    "race.html": lambda folder: write_player(LOG, folder / "race.html"),
    "index.html": lambda folder: write_page(SELECTION, folder),
    "ranking.xlsx": lambda folder: write_spreadsheet(SELECTION, folder / "ranking.xlsx"),
    "entrants.csv": lambda folder: write_tables(SELECTION, folder),
}


@contextmanager
def room(size: int) -> Iterator[None]:
    """No file grows beyond a size, bytes."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.mark.parametrize("name", WRITERS)
def test_nothing_is_left_of_what_does_not_fit(name: str, tmp_path: Path) -> None:
    output = OutputFolder(tmp_path / "out")
    with (
        pytest.raises(InputError, match=r"out: cannot be written: .*; expected room"),
        output.filling(),
        room(2000),
    ):
        WRITERS[name](output.report)
    assert list(output.report.iterdir()) == []


def test_what_was_there_stays(tmp_path: Path) -> None:
    output, path = OutputFolder(tmp_path), tmp_path / "summary.json"
    summary = build(np.random.default_rng(0), entrants=2).summary
    write_summary(path, summary)
    before = path.read_bytes()
    with pytest.raises(InputError, match="cannot be written"), output.filling(), room(2000):
        write_summary(path, summary.model_copy(update={"circuit": "b" * 3000}))
    assert path.read_bytes() == before
    write_summary(path, summary.model_copy(update={"circuit": "another"}))
    assert read_summary(path).circuit == "another"


def test_a_fault_of_ours_is_not_taken_for_a_full_disk(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), OutputFolder(tmp_path).filling():
        (tmp_path / "nowhere" / "file").write_text("x")
