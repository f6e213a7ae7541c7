"""The verdict comes before report and recordings, and what is stopped after it goes on."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterable
from pathlib import Path

import pytest

from nathlon.arena.store import Store
from nathlon.results.summary import read_summary
from nathlon.selection.run import DONE
from tests.nathlon.test_nightly import configure
from tests.support import forked
from tests.support.checkpoints import BUNDLED

CONFIG = """\
seed = 5
recordings = "all"
[pareto]
scenario = "slipstream_pass"
races = 1
most_races = 1
keep_probability = 0.0
opponents = ["driver:pace=0.9"]
[battery]
tests = ["pass_left"]
runs = 2
[committee]
shortlist = 2
[tournament]
event = "event.toml"
pairs = 3
"""
CHOSEN = ("lindenring-aggressive-004k", "lindenring-s1-008k", "lindenring-wake-028k")


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
def test_ctrl_c_after_the_verdict_loses_nothing(tmp_path: Path) -> None:
    configure(tmp_path, CONFIG)
    config, out = tmp_path / "nathlon.toml", tmp_path / "out"
    checkpoints = [path for path in BUNDLED if path.stem in CHOSEN]
    command: list[str | Path] = ["evaluate", *checkpoints, "--config", config, "--out", out, "--workers", "1"]

    process = forked.start(*command, cwd=tmp_path)
    verdict = _verdict(process.stdout)
    assert not (out / "report" / "index.html").exists()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate()
    assert process.returncode == 130
    assert "Stopped. The same command goes on" in said
    assert "Traceback" not in said
    status, raced = _stored(out)
    assert status != DONE

    again = forked.run(*command, cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert _verdict(again.stdout.splitlines()) == verdict
    assert _stored(out) == (DONE, raced)
    summary = read_summary(out / "summary.json")
    assert (out / "report" / "index.html").exists()
    assert summary.sent[0].name in verdict[-1]
    races = sum(stage.races for stage in summary.stages if stage.name == "tournament")
    assert len([path for path in (out / "races").glob("*.mcap") if path.stem != "final"]) == races > 0


def _verdict(lines: Iterable[str]) -> list[str]:
    """What is printed up to the one that is sent."""
    said = []
    for line in lines:
        said.append(line.rstrip())
        if line.startswith("Sent"):
            return said
    raise AssertionError(said)


def _stored(out: Path) -> tuple[str, list[str]]:
    """Status of the run in a folder, and the matches that are stored."""
    with Store.open(out / "store.sqlite") as store:
        [record] = store.runs()
        return record.status, sorted(store.results()["match"].unique())
