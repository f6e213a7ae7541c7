"""Files written whole or not at all: old content kept, nothing left over, processes that meet."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import whole_file, write_whole, writing

OTHER = """
import sys
from pathlib import Path
from nathlon.sim.whole_file import whole_file

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


KILLED = """
import os, signal, sys
from pathlib import Path
from nathlon.sim.whole_file import whole_file

with whole_file(Path(sys.argv[1])) as partial:
    partial.write_text("half")
    print(partial.name, flush=True)
    if sys.argv[2] == "wait":
        sys.stdin.read()
    os.kill(os.getpid(), signal.SIGKILL)
"""


def write_in_another_process(path: Path) -> None:
    subprocess.run([sys.executable, "-c", OTHER, path, "well"], check=True)


def test_what_a_killed_process_left_is_removed_by_the_next_one_that_writes_there(path: Path) -> None:
    killed = subprocess.run([sys.executable, "-c", KILLED, path, "die"], capture_output=True, text=True)
    assert files(path) == {"table.csv": "old", killed.stdout.strip(): "half"}
    write_in_another_process(path.with_name("other"))
    assert files(path) == {"table.csv": "old", "other": "theirs"}


def test_what_another_process_is_writing_is_left_alone(path: Path) -> None:
    command = [sys.executable, "-c", KILLED, str(path), "wait"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as writing:
        assert writing.stdout is not None
        name = writing.stdout.readline().strip()
        write_in_another_process(path.with_name("other"))
        assert files(path)[name] == "half"
        # As one that had the same number left it.
        *front, start, process, _ = name.split(".")
        earlier = f"{'.'.join(front)}.{int(start) - 1}.{process}.partial"
        path.with_name(name).rename(path.with_name(earlier))
        write_in_another_process(path.with_name("other"))
        assert earlier not in files(path)


def test_files_that_are_nobodys_here_stay(path: Path) -> None:
    killed = subprocess.run([sys.executable, "-c", KILLED, path, "die"], capture_output=True, text=True)
    name = killed.stdout.strip()
    *front, machine, start, process, _ = name.split(".")
    elsewhere = f"{'.'.join(front)}.{(int(machine, 16) + 1) % 2**32:08x}.{start}.{process}.partial"
    for other in (
        elsewhere,
        name[1:],
        f"{name}.mcap",
        ".table.csv.partial",
        f"{'.'.join(front)}.{process}.partial",
    ):
        path.with_name(other).write_text("theirs")
    write_in_another_process(path.with_name("other"))
    assert set(files(path)) == {
        "table.csv", "other", elsewhere, name[1:], f"{name}.mcap", ".table.csv.partial",
        f"{'.'.join(front)}.{process}.partial",
    }  # fmt: skip


def test_a_folder_by_another_name_is_the_same_folder(path: Path) -> None:
    alias = path.parent.with_name(f"{path.parent.name}-alias")
    alias.symlink_to(path.parent)
    with whole_file(path) as one:
        one.write_text("one")
        with whole_file(alias / "other") as other:
            other.write_text("two")
    assert files(path) == {"table.csv": "one", "other": "two"}


def test_what_cannot_be_written_is_named_with_its_path(tmp_path: Path) -> None:
    path = tmp_path / "none" / "map.png"
    with (
        pytest.raises(InputError, match=r"map\.png: the map cannot be written: No such file"),
        writing(path, "map"),
    ):
        write_whole(path, b"")
    with pytest.raises(InputError, match=r"map\.png: cannot be written: No such file"), writing(path):
        write_whole(path, b"")


def test_texts_and_bytes_are_written_whole(tmp_path: Path) -> None:
    path = tmp_path / "said.txt"
    write_whole(path, "größer\n")
    assert path.read_bytes() == "größer\n".encode()
    write_whole(path, b"\x00")
    assert [each.name for each in tmp_path.iterdir()] == ["said.txt"]
    assert path.read_bytes() == b"\x00"
