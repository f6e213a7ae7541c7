"""`nathlon watch`: small nights as checkpoints come, the newest of promising training runs first."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import pytest

import nathlon.commands.watch as command
from nathlon.arena.store import Store
from nathlon.results.summary import SetAside
from nathlon.selection.nightly.night import HEALTH, NIGHT, OK, Night
from nathlon.selection.nightly.promise import SETTLED_S, Promising, promise_of_runs
from nathlon.selection.run import DONE
from nathlon.sim.errors import InputError
from tests.support.command_line import nathlon
from tests.support.games import player, world_of

HOUR_S = 3600.0


def checkpoint(folder: Path, name: str, age_s: float) -> str:
    """A file that was last changed so long ago."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(name)
    os.utime(path, (time.time() - age_s,) * 2)
    return str(path)


def test_the_newest_of_promising_runs_come_first_and_what_is_being_written_waits(tmp_path: Path) -> None:
    good = [checkpoint(tmp_path, f"good/{age}.onnx", age * HOUR_S) for age in (1, 2, 3)]
    weak = [checkpoint(tmp_path, f"weak/{age}.onnx", age * HOUR_S) for age in (0.5, 1.5)]
    unknown = checkpoint(tmp_path, "unknown/9.onnx", 9 * HOUR_S)
    fresh = checkpoint(tmp_path, "good/now.onnx", 0.0)
    promise = {str(tmp_path / "good"): 0.8, str(tmp_path / "weak"): 0.1}
    sources = [*weak, *good, unknown, fresh]
    # 1.0 of a run that nobody has judged; 0.8, 0.4 and 0.2; 0.1 and 0.05.
    expected = [unknown, *good, *weak]
    assert Promising(10, promise)(sources) == expected
    assert Promising(2, promise)(sources) == expected[:2]
    assert Promising(10, {})([fresh]) == []
    os.utime(fresh, (time.time() - SETTLED_S - 1.0,) * 2)
    assert Promising(10, {})([fresh]) == [fresh]
    os.utime(fresh, (time.time() + HOUR_S,) * 2)
    assert Promising(10, {})([fresh]) == [fresh], "dated by another machine"


def test_checkpoints_are_judged_as_they_come(tmp_path: Path) -> None:
    world = world_of(tmp_path, "PettingZooWorld({'duel': envs['duel']})")
    for number, (run, right) in enumerate((("a", 3), ("a", 2), ("b", 0))):
        (tmp_path / run).mkdir(exist_ok=True)
        path = player(tmp_path / run / f"step-{number}.onnx", right)
        os.utime(path, (time.time() - HOUR_S * (1 + number),) * 2)
    (tmp_path / "nathlon.toml").write_text(
        f"""checkpoints = ["a", "b"]
world = {json.dumps(world)}
recordings = "notable"
[pareto]
races = 2
most_races = 2
keep_probability = 0.0
[battery]
runs = 2
[tournament]
pairs = 2
block = 2
[nightly]
anchors = []
"""
    )
    done = nathlon("watch", "--most", "2", "--wait", "0", "--workers", "1", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    nights = json.loads(done.stdout)["nights"]
    assert [night["name"] for night in nights] == [f"{NIGHT}0001", f"{NIGHT}0002"]
    with Store.open(tmp_path / "nathlon.sqlite") as store:
        records = store.runs()
        judged = [[one["name"] for one in record.config["field"]["newcomers"]] for record in records]
        # The newest of either run, and then what is left.
        assert [len(names) for names in judged] == [2, 1]
        assert {Path(name).name for name in judged[0]} == {"step-0", "step-2"}
        promise = promise_of_runs(store, records)
    assert promise[str(tmp_path / "a")] > promise[str(tmp_path / "b")]


def test_trouble_that_comes_later_ends_nothing_and_ctrl_c_loses_no_night(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A disk that is away for a while; at the first look it is a mistake of whoever has written the file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nathlon.toml").write_text("")
    Store(tmp_path / "nathlon.sqlite").close()
    quiet = Night(None, DONE, OK, "Nothing is new.", None)
    told = Night(None, DONE, HEALTH, "All was set aside.", None, (SetAside("a.onnx", "is empty", None),))
    away = InputError("checkpoints: no such file or folder")
    looks: list[Night | InputError | KeyboardInterrupt] = [quiet, away, away, told, away, KeyboardInterrupt()]

    def hold(*_: object) -> Night:
        look = looks.pop(0)
        if isinstance(look, BaseException):
            raise look
        return look

    monkeypatch.setattr(command, "hold_night", hold)
    monkeypatch.setattr("nathlon.commands.watch.time.sleep", lambda _: None)
    with pytest.raises(SystemExit) as ended:
        command.watch(Path("nathlon.toml"), as_json=True)
    assert ended.value.code == 130
    said = capsys.readouterr()
    assert [night["reason"] for night in json.loads(said.out)["nights"]] == [told.reason]
    # Once each time that it begins.
    assert said.err.count("checkpoints: no such file or folder. Looking again every 30 s.") == 2
    looks += [away]
    with pytest.raises(InputError, match="no such file"):
        command.watch(Path("nathlon.toml"), as_json=True)
    assert capsys.readouterr().out == ""
    looks += [quiet, away]
    moments = iter([0.0, 0.0, 9.0])
    monkeypatch.setattr("nathlon.commands.watch.time.monotonic", lambda: next(moments))
    with pytest.raises(InputError, match="no such file"):
        command.watch(Path("nathlon.toml"), wait=5.0, as_json=True)
