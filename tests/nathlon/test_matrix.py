"""`nathlon matrix`: planted regressions are found, what cannot be driven is said, and it resumes."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import nathlon
from benchmarks import planted_cells
from benchmarks.planted_cells import MARGINS, truth
from nathlon.arena.pool import Pool
from nathlon.arena.recording import read_recording
from nathlon.judge.matrix.cells import CellSetting, plan_cells
from nathlon.selection.config import Config
from nathlon.selection.matrix_settings import MatrixSettings
from nathlon.sim.errors import InputError
from tests.support.command_line import nathlon as command
from tests.support.command_line import refused

WORLD = f"{planted_cells.__file__}:PLANTED"
REPOSITORY = Path(__file__).parent.parent.parent
OTHER = "driver:pace=0.9"
SPECIALIST = REPOSITORY / "policies" / "bundled" / "lindenring" / "lindenring-again-056k.safetensors"


@pytest.fixture(scope="module", autouse=True)
def own_path() -> Iterator[None]:
    """The world's neighbours are not for other tests: one is called `cuda`, as a package of PyTorch's."""
    before = sys.path[:]
    yield
    sys.path[:] = before


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Pool(1) as pool:
        yield pool


@pytest.fixture
def policies(tmp_path: Path) -> tuple[Path, Path]:
    new, old = tmp_path / "new.onnx", tmp_path / "old.onnx"
    for path in (new, old):
        path.write_text(path.stem)
    return new, old


def planted(folder: Path, old: Path, scenarios: int = 7, more: str = "") -> Path:
    path = folder / "planted.toml"
    names = json.dumps([f"s{number:03d}" for number in range(scenarios)])
    path.write_text(
        f"world = {json.dumps(WORLD)}\nworkers = 1\n[matrix]\nscenarios = {names}\n"
        f"opponents = ['{old}']\n{more}"
        f'[matrix.margins]\nscore = {MARGINS["score"]}\n"own.slips" = {MARGINS["own.slips"]}\n'
    )
    return path


def test_large_regressions_are_found_and_alike_cells_are_not(
    policies: tuple[Path, Path], tmp_path: Path
) -> None:
    new, old = policies
    config = planted(tmp_path, old)
    result = nathlon.matrix(new, tmp_path / "out", baseline=old, config=config, progress=False)
    cells = result.cells.filter(measure="score").with_columns(
        pl.struct("scenario", "place")
        .map_elements(lambda one: truth(one["scenario"], one["place"]).score, pl.Float64)
        .alias("truth")
    )
    assert cells.height == 7 * 8
    large, alike = cells.filter(pl.col("truth") > 2.0), cells.filter(pl.col("truth") <= MARGINS["score"])
    assert large.height >= 5
    assert (large["verdict"] == "worse").all()
    assert (alike["verdict"] == "worse").sum() <= 1
    assert cells["verdict"][0] == "worse"
    assert (large["low"] > 0).all()
    # Only what looked worse was driven on, and until it was proven.
    assert cells["runs"].min() == 4
    assert cells["runs"].max() == 4 + 128
    assert np.median(large["runs"].to_numpy()) < 4 + 128
    again = nathlon.matrix(new, tmp_path / "out", baseline=old, config=config, progress=False)
    assert again.report.cells == result.report.cells


def test_other_cells_change_nothing_in_a_cell(policies: tuple[Path, Path], tmp_path: Path) -> None:
    new, old = policies
    marks = []
    for scenarios in (2, 3):
        config = planted(tmp_path, old, scenarios, "confirm = 0\n")
        out = tmp_path / f"out{scenarios}"
        cells = nathlon.matrix(new, out, baseline=old, config=config, progress=False).cells
        marks.append(
            cells.filter(scenario="s001").select("place", "measure", "policy", "baseline").sort(pl.all())
        )
    assert marks[0].equals(marks[1])


def test_a_slower_driver_is_worse_wherever_it_can_drive(tmp_path: Path) -> None:
    config = tmp_path / "quick.toml"
    config.write_text(
        "[matrix]\nscenarios = ['following', 'standing_start']\nplaces = [1, 2, 30]\ndelays_s = [0.0]\n"
        "most_runs = 8\nreplays = 1\n[matrix.margins]\npace = 0.005\n"
    )
    done = command("matrix", "driver:pace=0.9", "--config", config, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0
    assert "driver:pace=0.9 is worse than driver in 4 of 4 cells." in done.stdout
    report = json.loads((tmp_path / "out" / "matrix.json").read_text())
    assert all(0.05 < cell["findings"][0]["worse"] < 0.2 for cell in report["cells"])
    [page] = [cell["replay"] for cell in report["cells"] if cell["replay"]]
    assert (tmp_path / "out" / page).stat().st_size > 10_000
    logs = [read_recording(tmp_path / "out" / f"replays/01-{who}.mcap") for who in ("policy", "baseline")]
    assert logs[0].seed == logs[1].seed
    assert [log.names.count("driver:pace=0.9") for log in logs] == [1, 0]
    assert pl.read_csv(tmp_path / "out" / "matrix.csv").height == 4


def test_pairs_that_a_policy_cannot_drive_are_said(tmp_path: Path) -> None:
    config = tmp_path / "quick.toml"
    config.write_text(
        "[matrix]\ncircuits = ['lindenring', 'porto-sereno']\nscenarios = ['time_trial', 'no_such_race']\n"
        "places = [1]\ndelays_s = [0.0]\nconfirm = 0\n"
    )
    with pytest.raises(InputError, match="scenario 'no_such_race' is unknown"):
        nathlon.matrix(SPECIALIST, tmp_path / "out", config=config, progress=False)
    config.write_text(config.read_text().replace(", 'no_such_race'", ""))
    report = nathlon.matrix(SPECIALIST, tmp_path / "out", config=config, progress=False).report
    assert {cell.circuit for cell in report.cells} == {"lindenring"}
    [sentence] = [said for said in report.set_aside if said.startswith("porto-sereno with gt3: ")]
    assert "expected" in sentence


def test_a_margin_of_no_measure_is_refused(tmp_path: Path) -> None:
    config = tmp_path / "wrong.toml"
    config.write_text("[matrix.margins]\nbeauty = 1.0\n")
    refused(command("matrix", "driver:pace=0.9", "--config", config, cwd=tmp_path), "margins has 'beauty'")


@pytest.mark.parametrize(
    ("policy", "settings", "said"),
    [
        ("driver", {}, "driver: is the baseline, expected another policy"),
        (OTHER, {"compounds": ("glue",), "scenarios": ("following",)}, "compound 'glue' is unknown"),
        (OTHER, {"cars": ("nocar",)}, "section matrix: cars: car 'nocar' is unknown; expected one of"),
        (OTHER, {"circuits": ("nowhere",)}, "section matrix: circuits: circuit 'nowhere' is unknown"),
        (OTHER, {"places": (99,), "scenarios": ("following",)}, "driven: scenario 'following' has 2 places"),
    ],
)
def test_what_nobody_can_drive_is_said_with_the_reason(
    pool: Pool, policy: str, settings: dict[str, Any], said: str
) -> None:
    config = Config(circuit="lindenring", car="gt3", matrix=MatrixSettings(**settings))
    with pytest.raises(InputError, match=said):
        plan_cells(pool, policy, "driver", config)


def test_a_setting_is_a_scenario_with_tyres_and_delay() -> None:
    assert CellSetting("lindenring", "gt3", "race", "", 0.0).raced == "race"
    assert (
        CellSetting("lindenring", "gt3", "race", "racing-soft", 0.1).raced
        == "race:compound=racing-soft,delay=0.1"
    )
    assert CellSetting("a", "b", "race", "", 0.0, 20.0, 2, 12.0).raced == "race:hz=20,blur=2,noise=12"
