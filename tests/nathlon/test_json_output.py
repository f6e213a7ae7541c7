"""`--json`: every command has it, and then prints one JSON value and nothing else."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import typer

from nathlon.arena.recording import write_recording
from nathlon.cli import app
from tests.support.centre_lines import path_of, stadium, write_line
from tests.support.checkpoints import BUNDLED
from tests.support.command_line import nathlon
from tests.support.race_logs import oval_race
from tests.support.trainings import CHECKPOINTS, TOML


def said(*arguments: str | Path, cwd: Path) -> Any:
    """What a command that goes well prints with `--json`."""
    done = nathlon(*arguments, "--json", cwd=cwd)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_every_command_has_it() -> None:
    def commands(group: Any) -> list[Any]:
        below = getattr(group, "commands", None)
        return [group] if below is None else [one for each in below.values() for one in commands(each)]

    found = commands(typer.main.get_command(app))
    assert len(found) > 20
    for command in found:
        assert any("--json" in parameter.opts for parameter in command.params), command.name


def test_init(tmp_path: Path) -> None:
    assert said("init", "mine.toml", cwd=tmp_path)["configuration"] == "mine.toml"


def test_observation(tmp_path: Path) -> None:
    layout = said("observation", "--course-points", "7", cwd=tmp_path)
    assert layout["size"] == sum(field["size"] for field in layout["fields"])
    [course] = [field for field in layout["fields"] if field["name"].startswith("course")]
    assert course["size"] == 7 * 9


def test_a_circuit(tmp_path: Path) -> None:
    write_line(tmp_path / "line.csv", path_of(stadium()))
    made = said("track", "import", "line.csv", "--name", "stadium", cwd=tmp_path)
    assert made["circuit"] == "stadium/circuit.toml"
    shown = said("track", "show", made["circuit"], cwd=tmp_path)
    assert shown["length_m"] == pytest.approx(made["length_m"])
    assert {section["kind"] for section in shown["sections"]} >= {"straight", "corner"}
    turn = next(section for section in shown["sections"] if section["turns"])
    assert turn["turns"] == ["left"]
    assert turn["least_radius_m"] > 10.0
    assert (tmp_path / shown["map"]).is_file()


def test_a_recording(tmp_path: Path) -> None:
    write_recording(tmp_path / "race.mcap", oval_race(cars=2, duration_s=5.0))
    shown = said("replay", "race.mcap", "--no-open", cwd=tmp_path)
    assert (tmp_path / shown["replay"]).is_file()
    page = said("replay", "race.mcap", "--html", "race.html", cwd=tmp_path)
    assert page == {"page": "race.html"}
    saved = said("replay", "race.mcap", "--recover", cwd=tmp_path)
    assert saved["whole"]
    assert (tmp_path / saved["recording"]).is_file()


def test_an_export(tmp_path: Path) -> None:
    assert said("export", BUNDLED[0], "--onnx", "x.onnx", cwd=tmp_path) == {"onnx": "x.onnx"}


def test_a_training_and_an_ablation(tmp_path: Path) -> None:
    (tmp_path / "small.toml").write_text(TOML)
    trained = said("train", "small.toml", "--out", "run", cwd=tmp_path)
    assert trained["updates"] == CHECKPOINTS[-1]
    assert len(list((tmp_path / trained["checkpoints"]).iterdir())) == len(CHECKPOINTS)
    ablated = said(
        "ablate", "small.toml", "--out", "ablation", "--seeds", "1", "--variant", "n-step-5", cwd=tmp_path
    )
    assert ablated["runs"] == 1
    assert (tmp_path / ablated["table"]).is_file()
