"""A matrix's runs that are not completed: counted for both, compared in nothing else, and said."""

from __future__ import annotations

import json
from pathlib import Path

import nathlon
from nathlon.api.matrix import MatrixResult
from tests.support import planted_laps

CONFIG = """
world = {world}
workers = 1
[matrix]
runs = 40
most_runs = 40
[matrix.margins]
score = 0.5
"""


def compared(folder: Path, policy: str, baseline: str) -> MatrixResult:
    for name in (policy, baseline):
        (folder / f"{name}.onnx").write_text(name)
    config = folder / "matrix.toml"
    config.write_text(CONFIG.format(world=json.dumps(f"{planted_laps.__file__}:PLANTED")))
    return nathlon.matrix(
        folder / f"{policy}.onnx",
        folder / "out",
        baseline=folder / f"{baseline}.onnx",
        config=config,
        progress=False,
    )


def test_who_breaks_down_is_not_worse_in_what_it_completes(tmp_path: Path) -> None:
    report = compared(tmp_path, "fragile-40", "old").report
    [cell] = report.cells
    [score] = cell.findings
    assert score.verdict == "no sign"
    assert score.worse is not None
    assert abs(score.worse) < 0.5
    assert (cell.policy_broken > 8, cell.baseline_broken) == (True, 0)
    assert report.headline.endswith("It breaks down more often.")


def test_a_baseline_that_breaks_down_is_said_on_the_page(tmp_path: Path) -> None:
    result = compared(tmp_path, "new", "brittle-10")
    report = result.report
    [cell] = report.cells
    assert (cell.policy_broken, report.policy_broken) == (0, 0)
    assert 0 < report.baseline_broken == cell.baseline_broken < 12
    assert not report.breaks_more
    assert f"brittle-10 in {report.baseline_broken}" in report.completion
    assert report.completion in (result.folder / "index.html").read_text()
    assert cell.verdict == "no sign"
