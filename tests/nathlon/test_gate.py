"""`nathlon gate`: a slower driver fails, an equal one passes, and what cannot be told is said; it resumes."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
import yaml

import nathlon
from nathlon.arena.decision import Decision
from nathlon.arena.entrant import enter
from nathlon.arena.store import Store
from nathlon.judge.gate.gate import other_gates
from nathlon.judge.gate.series import RunPair
from nathlon.results.gate import Gated
from nathlon.selection.run import DONE, Run
from nathlon.sim.errors import InputError
from tests.support import planted_laps
from tests.support.command_line import nathlon as command

QUICK = """
circuit = "lindenring"
[tournament]
format = "1v1"
[gate]
points = 2.0
at_fault_per_km = 1.0
pairs = {pairs}
runs = 8
breakdowns = 0.5
block = 4
"""
DOCS = Path(__file__).parent.parent.parent / "docs"


def configuration(folder: Path, pairs: int = 4, more: str = "") -> Path:
    path = folder / "quick.toml"
    path.write_text(QUICK.format(pairs=pairs) + more)
    return path


def test_a_slower_driver_may_not_replace_the_built_in_one(tmp_path: Path) -> None:
    done = command(
        "gate", "driver:pace=0.9", "--champion", "driver", "--out", "out",
        "--config", configuration(tmp_path), cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 1
    assert "driver:pace=0.9 may not replace driver." in done.stdout
    out = tmp_path / "out"
    report = json.loads((out / "gate.json").read_text())
    [candidate] = report["candidates"]
    lap = next(finding for finding in candidate["findings"] if finding["measure"] == "lap time")
    assert lap["verdict"] == "fail"
    assert lap["high"] < -0.5
    assert {"gate.md", "junit.xml", "index.html"} <= {path.name for path in out.iterdir()}


def test_a_faster_driver_may_and_nothing_runs_twice(tmp_path: Path) -> None:
    config = configuration(tmp_path)
    first = nathlon.gate("driver", "driver:pace=0.9", tmp_path / "out", config=config, progress=False)
    assert first.verdict == Decision.PASS
    assert first.passed == ["driver"]
    assert first.findings.filter(measure="points")["difference"].item() > 0
    with Store(tmp_path / "out" / "store.sqlite") as store:
        [run] = [record.name for record in store.runs()]
        rows = store.results_of_run(run).height
    again = nathlon.gate("driver", "driver:pace=0.9", tmp_path / "out", config=config, progress=False)
    assert again.report.candidates == first.report.candidates
    with Store(tmp_path / "out" / "store.sqlite") as store:
        assert store.results_of_run(run).height == rows


def test_a_skill_test_may_decide(tmp_path: Path) -> None:
    tests = 'tests = ["hot_lap"]\nlap = 0.5\n'
    config = configuration(tmp_path, more=tests)
    result = nathlon.gate("driver:pace=0.95", "driver", tmp_path / "out", config=config, progress=False)
    [skill] = result.findings.filter(measure="hot lap").to_dicts()
    assert skill["verdict"] == "fail"
    assert skill["difference"] < -50


def test_the_champion_is_no_candidate(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="driver: is the champion itself"):
        nathlon.gate("driver", "driver", tmp_path / "out", config=configuration(tmp_path), progress=False)


def test_files_with_the_same_contents_are_said(tmp_path: Path) -> None:
    planted = f"{planted_laps.__file__}:PLANTED"
    config = tmp_path / "laps.toml"
    config.write_text(f"world = {json.dumps(planted)}\nworkers = 1\n[pareto]\ntime_trial = 'solo'\n")
    for name in ("old", "new", "twin", "copy"):
        (tmp_path / f"{name}.onnx").write_text("old" if name in ("old", "copy") else "new")
    old, new, twin, copy = (str(tmp_path / f"{name}.onnx") for name in ("old", "new", "twin", "copy"))
    with pytest.raises(InputError, match=rf"{old}, {copy}: is the champion itself"):
        nathlon.gate([old, copy], old, tmp_path / "out", config=config, progress=False)
    result = nathlon.gate([old, copy, new, twin], old, tmp_path / "out", config=config, progress=False)
    assert result.report.remarks == [
        f"Same file as new: {twin}.",
        f"Same file as the champion old, left out: {old}, {copy}.",
    ]


def test_other_gates_of_the_same_two_are_said(tmp_path: Path) -> None:
    """Whoever asks with seed after seed until one passes has spent more than one alpha."""
    new, old = (enter(name, "lindenring", "gt3") for name in ("driver:pace=0.9", "driver"))
    with Store(tmp_path / "store.sqlite") as store:
        for name, config, field in (
            ("gate-this", "seed 1", [old.id, new.id]),
            ("gate-same", "seed 1", [old.id, new.id, "another candidate"]),
            ("gate-other", "seed 2", [old.id, new.id]),
            ("gate-turned", "seed 3", [new.id, old.id]),
            ("matrix-other", "seed 4", [old.id, new.id]),
        ):
            store.begin_run(name, {"config": config, "entrants": field})
            store.end_run(name, DONE)
        store.begin_run("gate-stopped", {"config": "seed 5", "entrants": [old.id, new.id]})
        run = cast(Run, SimpleNamespace(store=store, name="gate-this"))
        assert other_gates(run, RunPair(new, old)) == 1
    gated = Gated(name="new", entrant=new.id, verdict=Decision.PASS, findings=(), other_gates=1)
    [note] = gated.notes
    assert "the store holds 1 of the same two with other seeds" in note
    assert not gated.model_copy(update={"other_gates": 0}).notes


def test_wrong_settings_are_one_sentence(tmp_path: Path) -> None:
    config = configuration(tmp_path, more="margin = 3\n")
    done = command("gate", "driver", "--champion", "driver:pace=0.9", "--config", config, cwd=tmp_path)
    assert done.returncode == 2
    assert "margin" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_the_workflow_of_the_page_is_one() -> None:
    text = (DOCS / "gate.md").read_text()
    workflow = yaml.safe_load(text.split("```yaml\n")[1].split("```")[0])
    steps = workflow["jobs"]["gate"]["steps"]
    [gate] = [step["run"] for step in steps if "nathlon gate" in step.get("run", "")]
    assert "--champion" in gate
    assert any("junit.xml" in str(step.get("with", {})) for step in steps)
