"""Every way to select asks for the engine that its configuration names."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from nathlon.arena.claimant import owner_name
from nathlon.arena.store import Store
from nathlon.sim.process import HOST, PLACE
from tests.support.command_line import nathlon, refused
from tests.support.games import player, world_of


@pytest.mark.parametrize(
    "arguments",
    [
        ["nightly"],
        ["evaluate", "here/3.onnx", "here/1.onnx", "--out", "out"],
        ["gate", "here/3.onnx", "--champion", "here/1.onnx", "--out", "out"],
        ["matrix", "here/3.onnx", "--baseline", "here/1.onnx", "--out", "out"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_a_cluster_that_is_not_there_is_refused(arguments: list[str], tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    for right in (1, 3):
        player(tmp_path / "here" / f"{right}.onnx", right)
    world = world_of(tmp_path, 'PettingZooWorld({"duel": envs["duel"]})')
    (tmp_path / "nathlon.toml").write_text(
        f'world = "{world}"\ncheckpoints = ["here"]\nengine = "ray"\nengine_address = "127.0.0.1:9"\n'
    )
    done = nathlon(*arguments, "--config", "nathlon.toml", cwd=tmp_path)
    refused(done, "engine_address is '127.0.0.1:9'", "Connection refused", "expected a Ray cluster")
    for store in tmp_path.rglob("*.sqlite"):
        with Store.open(store) as opened:
            assert opened.runs() == []


def test_a_night_without_anybody_new_asks_for_no_cluster(tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "nathlon.toml").write_text(
        'checkpoints = ["here"]\nengine = "ray"\nengine_address = "127.0.0.1:9"\n'
    )
    done = nathlon("nightly", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["reason"].startswith("Nothing is new")


def test_an_engine_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    (tmp_path / "nathlon.toml").write_text('engine = "spark"\n')
    done = nathlon("nightly", "--config", "nathlon.toml", cwd=tmp_path)
    refused(done, "nathlon.toml", "engine", "'local' or 'ray'")


def test_status_lists_who_is_at_work(tmp_path: Path) -> None:
    (tmp_path / "nathlon.toml").write_text("")
    with Store(tmp_path / "nathlon.sqlite") as store:
        store.attend(owner_name(), 3, 60.0)
        store.attend(f"{PLACE}/{os.getpid()}/1/0", 2, 60.0)  # an earlier process of the same number
    told = nathlon("status", "--json", cwd=tmp_path)
    [worker] = json.loads(told.stdout)["workers"]
    assert (worker["host"], worker["process"], worker["processes"]) == (HOST, os.getpid(), 3)
    assert worker["seen_at"] is not None
    shown = nathlon("status", cwd=tmp_path).stdout
    assert f"At work      {HOST}, process {os.getpid()}, with 3" in shown
