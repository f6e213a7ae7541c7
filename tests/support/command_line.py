"""The command line, called in the process of the tests: what a command prints, and its exit code."""

from __future__ import annotations

import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import pytest

from nathlon.cli import STOPPED, main


class Done(NamedTuple):
    """A command that has ended."""

    returncode: int
    stdout: str
    stderr: str


def nathlon(*arguments: str | Path, cwd: Path, stops: bool = False) -> Done:
    """Call the console script; what stops it stops the tests, unless it `stops` by itself."""
    with (
        chdir(cwd),
        redirect_stdout(StringIO()) as stdout,
        redirect_stderr(StringIO()) as stderr,
        patch.object(sys, "argv", ["nathlon", *map(str, arguments)]),
        pytest.raises(SystemExit) as end,
    ):
        main()
    assert isinstance(end.value.code, int)
    if end.value.code == STOPPED and not stops:
        pytest.exit("stopped from outside, for instance by `timeout`, during a command")
    return Done(end.value.code, stdout.getvalue(), stderr.getvalue())


def refused(done: Done, *said: str) -> None:
    """Assert that the command refused its input with one sentence that says all of `said`."""
    assert done.returncode == 2, done.stderr
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    assert len(lines) == 1, done.stderr
    for words in said:
        assert words in lines[0]
