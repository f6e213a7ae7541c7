"""The tutorial's commands run as they stand, one after the other, and end with what it promises."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import pytest

from tests.support import forked

pytestmark = pytest.mark.takes_long

PAGE = Path(__file__).parent.parent.parent / "docs" / "tutorial.md"
NOT_RUN = "<!-- not run by the test -->\n"
BLOCK = re.compile(
    rf'(?P<skip>{NOT_RUN})?```(?P<language>\w+)(?: title="(?P<file>[^"]+)")?\n(?P<text>.*?)```', re.DOTALL
)


PLAIN = re.compile(r"nathlon [\w ./=-]+")
"""A command of which a shell would change nothing."""


def parts(block: str) -> Iterator[str]:
    """The plain commands of a shell block, and what is between them."""
    for plain, lines in groupby(block.splitlines(), lambda line: bool(PLAIN.fullmatch(line))):
        if plain:
            yield from lines
        else:
            yield "\n".join(lines)


def follow(page: str, folder: Path) -> str:
    """Save the files that a page names and run its shell blocks in a folder; what they print."""
    # As after the tutorial's `. .venv/bin/activate`; one thread and one worker, as tests run side by side.
    environment = {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "OMP_NUM_THREADS": "1",
    }
    printed = ""
    for block in BLOCK.finditer(page):
        if block["file"]:
            alone = "workers = 1\n" if block["file"].endswith(".toml") else ""
            (folder / block["file"]).write_text(alone + block["text"], "utf-8")
        elif block["language"] == "sh" and not block["skip"]:
            for part in parts(block["text"]):
                done = _run(part, folder, environment)
                assert done.returncode == 0, f"{part}\n{done.stdout}\n{done.stderr}"
                printed += done.stdout
    return printed


def _run(part: str, folder: Path, environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    if PLAIN.fullmatch(part):
        return forked.run(*part.split()[1:], cwd=folder, **environment)
    return subprocess.run(
        ["bash", "-e", "-c", part],
        cwd=folder,
        env=os.environ | environment,
        capture_output=True,
        text=True,
    )


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder of somebody who has followed the tutorial, and what was printed."""
    folder = tmp_path_factory.mktemp("tutorial")
    return folder, follow(PAGE.read_text("utf-8"), folder)


def test_my_checkpoint_is_ranked(followed: tuple[Path, str]) -> None:
    _, printed = followed
    ranking = printed.partition("N-athlon")[2].partition("Tests")[0]
    rows = re.findall(r"│\s+(\d+)(?: to \d+)? *│ (\S+)\s+│\s+(-?\d+) \(", ranking)
    assert sorted(name for _, name, _ in rows) == [
        "lindenring-mend-059k",
        "lindenring-s1-020k",
        "lindenring-wake-028k",
        "mine",
    ]
    rank, name, points = rows[-1]
    assert (name, points) == ("mine", "0")  # 300 steps make no racer
    assert int(rank) > 1


def test_somebody_better_is_sent(followed: tuple[Path, str]) -> None:
    folder, printed = followed
    summary = json.loads((folder / "runs" / "first" / "summary.json").read_text("utf-8"))
    stages = {stage["name"]: stage for stage in summary["stages"]}
    assert stages["pareto"]["in"] == 4
    assert stages["pareto"]["out"] < 4  # mine comes round no lap
    assert re.search(r"Sent\s+lindenring-", printed)


def test_the_page_that_plays_the_race_is_there(followed: tuple[Path, str]) -> None:
    folder, _ = followed
    assert "<canvas" in (folder / "final.html").read_text("utf-8")


def test_what_the_tutorial_lists_is_there(followed: tuple[Path, str]) -> None:
    folder, _ = followed
    listed = re.findall(r"^\| `([^`]+)` \|", PAGE.read_text("utf-8"), re.MULTILINE)
    assert len(listed) == 6
    assert not [name for name in listed if not (folder / "runs" / "first" / name).exists()]
