"""Programs run as an ordinary user would run them: to root, permissions of files mean nothing."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.command_line import Done, nathlon

BOUND = ("setpriv", "--bounding-set=-dac_override,-dac_read_search")
CommandLine = Callable[..., Done]
"""Called as `tests.support.command_line.nathlon`."""


def ordinary(*command: str | Path) -> list[str]:
    """A command without root's right to pass over permissions; skips the test where that cannot be."""
    bound: tuple[str, ...] = ()
    if os.geteuid() == 0:
        able = shutil.which(BOUND[0]) and subprocess.run([*BOUND, "true"], capture_output=True)
        if not able or able.returncode:
            pytest.skip("root cannot give up its rights here: setpriv is missing or not permitted")
        bound = BOUND
    return [*bound, *map(str, command)]


@contextmanager
def ordinary_nathlon() -> Iterator[CommandLine]:
    """The command line in one process of an ordinary user: to start one for each command takes seconds."""
    command = ordinary(sys.executable, "-m", "tests.support.unprivileged")
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin
        assert process.stdout
        asked, answered = process.stdin, process.stdout

        def ask(*arguments: str | Path, cwd: Path) -> Done:
            print(json.dumps([str(cwd), *map(str, arguments)]), file=asked, flush=True)
            return Done(*json.loads(answered.readline()))

        yield ask
        asked.close()


if __name__ == "__main__":
    for line in sys.stdin:
        cwd, *arguments = json.loads(line)
        print(json.dumps(nathlon(*arguments, cwd=Path(cwd))), flush=True)
