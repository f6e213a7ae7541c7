"""Files written whole or not at all: old content kept, nothing left over, processes that meet."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from sim.whole_file import whole_file

OTHER = """
import sys
from pathlib import Path
from sim.whole_file import whole_file

with whole_file(Path(sys.argv[1])) as partial:
    partial.write_text("theirs")
    if sys.argv[2] == "fail":
        raise ValueError
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "table.csv"
    path.write_text("old")
    return path


def files(path: Path) -> dict[str, str]:
    return {file.name: file.read_text() for file in path.parent.iterdir()}


def test_readers_find_the_old_file_until_the_new_one_is_whole(path: Path) -> None:
    with whole_file(path) as partial:
        partial.write_text("half")
        assert path.read_text() == "old"
        partial.write_text("half and half")
    assert files(path) == {"table.csv": "half and half"}


def test_a_new_file_comes_into_being(tmp_path: Path) -> None:
    with whole_file(tmp_path / "new") as partial:
        partial.write_text("first")
    assert files(tmp_path / "new") == {"new": "first"}


@pytest.mark.parametrize("error", [OSError("no room"), KeyboardInterrupt()])
def test_what_fails_leaves_the_old_file_and_nothing_else(path: Path, error: BaseException) -> None:
    def write_half() -> None:
        with whole_file(path) as partial:
            partial.write_text("half")
            raise error

    with pytest.raises(type(error)):
        write_half()
    assert files(path) == {"table.csv": "old"}


def test_to_write_nothing_is_an_error(path: Path) -> None:
    with pytest.raises(FileNotFoundError), whole_file(path):
        pass
    assert files(path) == {"table.csv": "old"}


@pytest.mark.parametrize(("ends", "meanwhile"), [("well", "theirs"), ("fail", "old")])
def test_another_process_at_the_same_file_disturbs_neither(path: Path, ends: str, meanwhile: str) -> None:
    with whole_file(path) as partial:
        partial.write_text("ours")
        other = subprocess.run([sys.executable, "-c", OTHER, path, ends], stderr=subprocess.DEVNULL)
        assert (other.returncode == 0) == (ends == "well")
        assert path.read_text() == meanwhile
    assert files(path) == {"table.csv": "ours"}
