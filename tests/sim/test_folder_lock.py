"""A folder has one writer at a time, and a killed one leaves it free."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from nathlon.sim.errors import InputError
from nathlon.sim.folder_lock import LOCK_FILE, sole_user

HOLDING = (
    "import sys\nfrom pathlib import Path\nfrom nathlon.sim.folder_lock import sole_user\n"
    "with sole_user(Path(sys.argv[1])):\n    print('held', flush=True)\n    sys.stdin.read()\n"
)


def test_the_second_is_refused_until_the_first_is_done(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with sole_user(folder):
        (folder / "curve.csv").touch()
        with pytest.raises(InputError, match=r"run: another process is at work there"), sole_user(folder):
            pass
        with pytest.raises(InputError, match="another process"), sole_user(folder):
            pass
    with sole_user(folder):
        pass
    assert [path.name for path in folder.iterdir()] == ["curve.csv"]


def test_a_killed_process_leaves_the_folder_free(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLDING, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        with pytest.raises(InputError, match="another process"), sole_user(tmp_path):
            pass
        process.kill()
        process.wait()
    assert (tmp_path / LOCK_FILE).exists()
    with sole_user(tmp_path):
        pass
    assert not list(tmp_path.iterdir())


def test_a_folder_that_was_made_for_nothing_goes_again(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), sole_user(tmp_path / "new"):
        raise ZeroDivisionError
    assert not (tmp_path / "new").exists()
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file: cannot be written"), sole_user(tmp_path / "file"):
        pass
