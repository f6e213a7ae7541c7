"""What cannot be written in the end is refused at the beginning, before any work."""

from __future__ import annotations

from pathlib import Path

import pytest

from nathlon.sim.errors import InputError
from nathlon.sim.whole_file import check_output
from tests.support.checkpoints import BUNDLED
from tests.support.command_line import nathlon, refused

COMMANDS = (
    ["evaluate", BUNDLED[0], "--out", "taken"],
    ["gate", BUNDLED[0], "--champion", "driver", "--out", "taken"],
    ["matrix", BUNDLED[0], "--out", "taken/deeper"],
    ["recipes", BUNDLED[0].parent, "--out", "taken"],
    ["battery", BUNDLED[0], "--out", "taken"],
    ["pareto", BUNDLED[0], "--out", "taken"],
    ["nightly"],
    ["coach", "none.mcap", "--car", "1", "--out", "taken"],
    ["twin", "none.mcap", "--car", "1", "--policy", "driver", "--out", "taken"],
    ["race", "driver", "--qualify", "--record", "--out", "taken"],
    ["incident", "none.mcap", "--at", "3", "--car", "1", "--name", "x", "--out", "taken"],
    ["replay", "race.mcap", "--html", "taken/race.html"],
    ["replay", "race.mcap", "--video", "taken/race.mp4"],
    ["replay", "race.mcap", "--video", "nowhere/race.mp4"],
    ["replay", "race.mcap", "--video", "folder"],
    ["replay", "race.mcap", "k:0", "--out", "taken"],
    ["export", BUNDLED[0], "--onnx", "nowhere/x.onnx"],
    ["track", "generate", "--seed", "1", "--out", "taken"],
    ["track", "show", "lindenring", "--out", "taken/map.png"],
)


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: " ".join(map(str, command))[:30])
def test_no_work_is_done(command: list[str | Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def work(*_: object, **__: object) -> None:
        raise AssertionError("work has begun")

    for name in (
        "nathlon.arena.pool.Pool.__init__",
        "nathlon.arena.recording.read_recording",
        "nathlon.arena.store.Store.open",
        "nathlon.policies.checkpoint.load_checkpoint",
        "nathlon.sim.track.generating.write_generated",
        "nathlon.sim.track.map.draw_map",
    ):
        monkeypatch.setattr(name, work)
    monkeypatch.setattr("nathlon.arena.workers.start_server", lambda: None)
    for name in ("taken", "race.mcap"):
        (tmp_path / name).touch()
    (tmp_path / "folder").mkdir()
    (tmp_path / "nathlon.toml").write_text('out = "taken"')
    before = sorted(tmp_path.iterdir())
    refused(
        nathlon(*command, cwd=tmp_path), "cannot be written" if "folder" not in command else "is a folder"
    )
    assert sorted(tmp_path.iterdir()) == before


def test_nothing_is_left_of_a_check(tmp_path: Path) -> None:
    check_output(tmp_path / "new" / "deeper")
    check_output(tmp_path / "file", is_file=True)
    with pytest.raises(InputError, match="cannot be written"):
        check_output(Path("/proc/version/out"))
    (tmp_path / "astray").symlink_to("nowhere")
    with pytest.raises(InputError, match="cannot be written"):
        check_output(tmp_path / "astray")
    assert [path.name for path in tmp_path.iterdir()] == ["astray"]
