"""Standard output that is full, closed or left, and `--json` where there is no result."""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import TextIO
from unittest.mock import patch

import pytest

from nathlon import cli
from nathlon.commands.selection import stoppable
from nathlon.selection.nightly.night import Night
from tests.support.command_line import nathlon, refused

QUIET = Night(None, "done", 1, f"Nobody passed{'!' * 10_000}", None)


def ended(stdout: TextIO | None, *arguments: str) -> int:
    """The exit code of a command that prints there."""
    with (
        redirect_stdout(stdout),
        patch.object(sys, "argv", ["nathlon", *arguments]),
        pytest.raises(SystemExit) as end,
    ):
        cli.main()
    assert isinstance(end.value.code, int)
    return end.value.code


def full() -> TextIO:
    return open("/dev/full", "w")


def left() -> TextIO:
    """A pipe whose reader has gone."""
    reading, writing = os.pipe()
    os.close(reading)
    return os.fdopen(writing, "w")


@pytest.mark.parametrize("output", [full, left])
@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["observation"],
        ["observation", "--json"],
        ["world", "list"],
        ["nightly", "--json"],
        ["nightly"],
        ["race", "nobody", "--json"],
    ],
)
def test_results_that_cannot_be_written(
    output: object, arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nathlon.toml").touch()
    monkeypatch.setattr("nathlon.selection.nightly.night.nightly", lambda *_: QUIET)
    with output() as stdout:  # type: ignore[operator]
        assert ended(stdout, *arguments) == 2
    *before, last = capsys.readouterr().err.splitlines()
    assert last.startswith("nathlon: standard output: cannot be written: ")
    assert not before or "nobody: no such file" in before[0]


def test_no_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    assert ended(None, "observation") == 2
    assert capsys.readouterr().err == (
        "nathlon: standard output: is closed, expected one that can be written\n"
    )


def test_remarks_may_get_lost() -> None:
    with full() as stderr, redirect_stderr(stderr), open(os.devnull, "w") as stdout:
        assert ended(stdout, "race", "nobody") == 2


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["race", "nobody", "--json"], "nobody: no such file"),
        (["race", "--json"], "Missing argument"),
        (["race", "driver", "--speed", "--json"], "No such option"),
        (["race", "driver", "--seed", "x", "--json"], "--seed"),
        (["status", "--json", "--config", "none.toml"], "none.toml"),
        (["committee", "none.sqlite", "show", "--json"], "none.sqlite"),
    ],
)
def test_json_for_what_is_refused(arguments: list[str], error: str, tmp_path: Path) -> None:
    done = nathlon(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    said = json.loads(done.stdout)
    assert said["code"] == 2
    assert error in said["error"]
    assert said["error"] in done.stderr


def test_json_for_what_was_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(*_: object) -> None:
        with stoppable("The same command goes on."):
            raise KeyboardInterrupt

    (tmp_path / "nathlon.toml").touch()
    monkeypatch.setattr("nathlon.selection.nightly.night.nightly", stopped)
    done = nathlon("nightly", "--json", cwd=tmp_path, stops=True)
    assert done.returncode == 130
    assert json.loads(done.stdout) == {"error": "Stopped. The same command goes on.", "code": 130}


def test_json_is_printed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "nathlon.toml").touch()
    monkeypatch.setattr("nathlon.selection.nightly.night.nightly", lambda *_: QUIET)
    monkeypatch.setattr("nathlon.selection.nightly.night.told", lambda *_: None)
    done = nathlon("nightly", "--json", cwd=tmp_path)
    assert done.returncode == 1
    assert json.loads(done.stdout)["reason"] == QUIET.reason


def test_json_that_is_a_name_is_no_option(tmp_path: Path) -> None:
    done = nathlon("race", "--", "--json", cwd=tmp_path)
    refused(done, "--json: no such file")
    assert done.stdout == ""


@pytest.mark.parametrize("error", [KeyError("seats"), EOFError(), BrokenPipeError(), OSError("of no file")])
def test_a_fault_of_ours_has_a_code_and_a_log(
    error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*_: object) -> None:
        raise error

    (tmp_path / "nathlon.toml").touch()
    monkeypatch.setattr("nathlon.selection.nightly.night.nightly", failing)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    done = nathlon("nightly", "--json", cwd=tmp_path)
    assert done.returncode == 70
    (log,) = tmp_path.glob("nathlon-fault-*.log")
    assert done.stderr.count("\n") == 1
    assert str(log) in done.stderr
    assert json.loads(done.stdout)["code"] == 70
    assert "in failing" in log.read_text()


def test_a_command_that_is_terminated_ends_as_after_ctrl_c(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "nathlon.toml").touch()
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(
        "nathlon.selection.nightly.night.nightly", lambda *_: signal.raise_signal(signal.SIGTERM)
    )
    assert nathlon("nightly", cwd=tmp_path, stops=True).returncode == 130
    assert signal.getsignal(signal.SIGTERM) is before
