"""Commands that train are refused in a folder where another process does."""

from __future__ import annotations

from pathlib import Path

import pytest

from nathlon.policies.training.config import read_config
from nathlon.policies.training.run_folder import make_run_folder
from nathlon.sim.folder_lock import LOCK_FILE, sole_user
from tests.support.checkpoints import BUNDLED
from tests.support.command_line import nathlon, refused
from tests.support.trainings import TOML

LEAGUE = f"""
entrants = ["{BUNDLED[0]}", "{BUNDLED[1]}"]
training = "field.toml"
selection = "nathlon.toml"
"""


@pytest.mark.parametrize(
    "command",
    [
        ("train", "small.toml"),
        ("train", "--resume"),
        ("polish", BUNDLED[0], "--config", "small.toml"),
        ("ablate", "small.toml"),
        ("league", "league.toml"),
        ("reward", "design", "be fast"),
    ],
    ids=lambda command: " ".join(map(str, command[:2])),
)
def test_a_second_one_is_refused(tmp_path: Path, command: tuple[str, ...]) -> None:
    (tmp_path / "small.toml").write_text(TOML)
    (tmp_path / "field.toml").write_text(TOML.replace('opponents = ["driver"]\n', ""))
    (tmp_path / "nathlon.toml").touch()
    (tmp_path / "league.toml").write_text(LEAGUE)
    folder = tmp_path / "run"
    if "--resume" in command:
        make_run_folder(folder, read_config(tmp_path / "small.toml"), seed=1)
    before = {path.name for path in folder.rglob("*")}
    with sole_user(folder):
        refused(nathlon(*command, "--out", "run", cwd=tmp_path), "run: another process is at work there")
        assert {path.name for path in folder.rglob("*")} - before <= {LOCK_FILE}
