"""A night is told once to whoever asked for it, at whatever point its process is killed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from nathlon.arena.store import Store
from nathlon.selection.nightly.night import HEALTH, OK
from tests.nathlon.test_nightly import FORKED, WEAK, run, watch_two
from tests.support import forked
from tests.support.command_line import nathlon

TELLING = (
    FORKED
    + """
import nathlon.selection.nightly.night
from nathlon.commands import nightly as command
from nathlon.arena.store import Store

def dies_after(store, name, status, end=Store.end_run):
    end(store, name, status)
    dies()

def dying(place, name, death):
    setattr(place, name, death)
    command.nightly(command.Path("nathlon.toml"), 1, False)

outcome_stored = (Store, "end_run", dies)
run_ended = (Store, "end_run", dies_after)
printed = (nathlon.selection.nightly.night, "told", dies)
for point in (outcome_stored, run_ended, printed):
    assert is_killed(lambda: dying(*point)), point
"""
)


def test_a_night_killed_before_it_was_told_is_told_by_the_next(tmp_path: Path) -> None:
    watch_two(tmp_path)
    (tmp_path / "checkpoints" / "broken.safetensors").write_bytes(b"no checkpoint")
    done = forked.run("-c", TELLING, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    newcomer = Path(shutil.copy(WEAK, tmp_path / "checkpoints"))
    repeated = nathlon("nightly", "--workers", "1", "--json", cwd=tmp_path)
    night = json.loads(repeated.stdout)
    assert (repeated.returncode, night["code"], night["name"]) == (HEALTH, HEALTH, "night-0001")
    assert night["reason"] == "1 of 3 new files were set aside."
    assert len(night["summary"]["excluded"]) == 1
    newcomer.unlink()
    later = nathlon("nightly", "--workers", "1", cwd=tmp_path)
    assert (later.returncode, later.stdout.splitlines()[-1]) == (OK, "Outcome      Nothing is new.")
    with Store.open(tmp_path / "nathlon.sqlite") as store:
        facts: Any = store.facts("night-0001")
        assert facts["outcome"].pop("told") is True
        # As older versions left it: to them every night was told.
        store.put_fact("night-0001", "outcome", facts["outcome"])
    assert run(tmp_path).reason == "Nothing is new."
