"""The command line as a user meets it: bad input is one sentence, exit code 2, nothing left behind."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

from nathlon.policies.checkpoint import load_checkpoint, save_checkpoint
from nathlon.sim.data_file import DATA
from nathlon.sim.observation import ObservationSpec
from tests.support.checkpoints import BUNDLED
from tests.support.command_line import Done, nathlon, refused


def test_the_console_script(tmp_path: Path) -> None:
    script = Path(sys.executable).parent / "nathlon"
    arguments = ("track", "show", "atlantis")
    done = subprocess.run([script, *arguments], cwd=tmp_path, capture_output=True, text=True, check=False)
    refused(Done(done.returncode, done.stdout, done.stderr), "atlantis", "lindenring")


def test_help_names_every_command(tmp_path: Path) -> None:
    result = nathlon("--help", cwd=tmp_path)
    assert result.returncode == 0
    for command in ("demo", "evaluate", "train", "ablate", "race", "replay", "observation"):
        assert command in result.stdout
    headings = ["Options", "Select", "Judge", "Look", "Train", "Files"]
    assert re.findall(r"^(\w+):$", result.stdout, re.MULTILINE) == headings
    assert "..." not in result.stdout.partition("Select:")[2]


def test_the_observation_layout_can_be_printed(tmp_path: Path) -> None:
    result = nathlon("observation", "--course-points", "16", cwd=tmp_path)
    assert result.returncode == 0
    for field in ObservationSpec(course_points=16).fields:
        assert field.name in result.stdout


def test_a_missing_checkpoint(tmp_path: Path) -> None:
    refused(nathlon("evaluate", "none.safetensors", cwd=tmp_path), "none.safetensors", "no such file")
    assert not list(tmp_path.iterdir())


def test_a_truncated_checkpoint(tmp_path: Path) -> None:
    (tmp_path / "cut.safetensors").write_bytes(BUNDLED[0].read_bytes()[:5000])
    refused(nathlon("evaluate", "cut.safetensors", cwd=tmp_path), "cut.safetensors")


def test_a_foreign_file(tmp_path: Path) -> None:
    (tmp_path / "foreign.safetensors").write_bytes(b"PK\x03\x04" + bytes(1000))
    refused(nathlon("evaluate", "foreign.safetensors", cwd=tmp_path), "foreign.safetensors")


def test_a_folder_without_checkpoints(tmp_path: Path) -> None:
    refused(nathlon("evaluate", tmp_path, cwd=tmp_path), "holds no checkpoint")


def test_a_checkpoint_of_another_observation_version(tmp_path: Path) -> None:
    content = BUNDLED[0].read_bytes()
    other = content.replace(b'\\"version\\":2', b'\\"version\\":9')
    assert other != content
    (tmp_path / "old.safetensors").write_bytes(other)
    refused(nathlon("evaluate", "old.safetensors", cwd=tmp_path), "old.safetensors", "version is 9")


def test_checkpoints_of_different_circuits_do_not_meet(tmp_path: Path) -> None:
    policy = load_checkpoint(BUNDLED[0])
    tensors = {name: np.zeros(shape, np.float32) for name, shape in policy.card.shapes.items()}
    card = policy.card.model_copy(update={"circuit": "elsewhere"})
    save_checkpoint(tmp_path / "b.safetensors", tensors, card)
    shutil.copy(BUNDLED[0], tmp_path / "a.safetensors")
    done = nathlon("evaluate", "a.safetensors", "b.safetensors", cwd=tmp_path)
    refused(done, "b.safetensors", "circuit", "elsewhere")


def test_an_unknown_circuit_and_an_unknown_driver_setting(tmp_path: Path) -> None:
    refused(nathlon("race", "driver", "--circuit", "atlantis", cwd=tmp_path), "atlantis", "lindenring")
    known = "expected one of pace, lane, early, grip, temper"
    refused(nathlon("race", "driver:courage=1", cwd=tmp_path), "courage", known)


def test_a_car_with_negative_mass(tmp_path: Path) -> None:
    text = (DATA / "cars" / "gt3.toml").read_text()
    (tmp_path / "light.toml").write_text(text.replace("mass_kg = 1370.0", "mass_kg = -1.0"))
    refused(nathlon("race", "driver", "--car", "light.toml", cwd=tmp_path), "light.toml", "mass_kg", "-1.0")


def test_an_output_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    result = nathlon("evaluate", BUNDLED[0], "--out", tmp_path / "taken", cwd=tmp_path)
    refused(result, "taken", "cannot be written")
    assert (tmp_path / "taken").read_text() == "a file"


def test_a_recording_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "race.mcap").write_text("not a recording")
    refused(nathlon("replay", "race.mcap", "--no-open", cwd=tmp_path), "race.mcap")
    assert not (tmp_path / "race.rrd").exists()


def test_an_unknown_training_configuration(tmp_path: Path) -> None:
    refused(nathlon("train", "dreaming", cwd=tmp_path), "dreaming", "time_trial")
    refused(
        nathlon("train", "--resume", "--out", "nothing", cwd=tmp_path),
        "nothing",
        "no folder of a training run",
    )


def test_race_prints_json(tmp_path: Path) -> None:
    pair = ("driver:pace=0.9", "driver:pace=0.8")
    result = nathlon("race", *pair, "--scenario", "standing_start", "--json", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    rows = json.loads(result.stdout)
    assert [row["place"] for row in rows] == list(range(1, 9))
    assert {row["name"] for row in rows} == set(pair)


def test_race_prints_a_result_and_records(tmp_path: Path) -> None:
    arguments = [
        "race",
        "driver",
        "driver:pace=0.9",
        "--scenario",
        "slipstream_pass",
        "--record",
        "--out",
        "kept",
    ]
    result = nathlon(*arguments, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    times = re.findall(r"\d+\.\d{3}", result.stdout)
    assert len(times) >= 2, "each of the two has a time"
    assert (tmp_path / "kept" / "races" / "race.mcap").stat().st_size > 10_000
    shown = nathlon("replay", "kept/races/race.mcap", "--no-open", cwd=tmp_path)
    assert shown.returncode == 0, shown.stderr
    assert (tmp_path / "kept" / "races" / "race.rrd").stat().st_size > 10_000


def test_a_resumed_run_does_not_start_from_another(tmp_path: Path) -> None:
    result = nathlon("train", "--resume", "--from", "elsewhere", "--out", "runs", cwd=tmp_path)
    refused(result, "--from", "expected for a new run")
