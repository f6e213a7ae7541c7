"""A gate's runs that are not completed: counted exactly, compared with nothing, and said."""

from __future__ import annotations

import json
from pathlib import Path

import nathlon
from nathlon.api.gate import GateResult
from nathlon.arena.decision import Decision
from tests.support import planted_laps
from tests.support.command_line import nathlon as command

CONFIG = """
world = {world}
workers = 1
[pareto]
time_trial = "solo"
[gate]
points = 0.5
block = {block}
runs = {runs}
"""


def configuration(folder: Path, block: int = 64, runs: int = 192) -> Path:
    path = folder / "gate.toml"
    world = json.dumps(f"{planted_laps.__file__}:PLANTED")
    path.write_text(CONFIG.format(world=world, block=block, runs=runs))
    return path


def gated(folder: Path, champion: str, *candidates: str, block: int = 64, runs: int = 192) -> GateResult:
    for name in (champion, *candidates):
        (folder / f"{name}.onnx").write_text(name)
    return nathlon.gate(
        [folder / f"{name}.onnx" for name in candidates],
        folder / f"{champion}.onnx",
        folder / "out",
        config=configuration(folder, block, runs),
        progress=False,
    )


def completions(result: GateResult) -> list[dict[str, object]]:
    return result.findings.filter(measure="completion").to_dicts()


def test_rare_breakdowns_do_not_pass_for_good_laps(tmp_path: Path) -> None:
    result = gated(tmp_path, "old", *(f"{letter}-5" for letter in "abcdefgh"), block=16, runs=64)
    assert len(result.passed) <= 1


def test_an_equal_passes_and_the_page_says_what_is_ruled_out(tmp_path: Path) -> None:
    result = gated(tmp_path, "old", "other")
    assert result.verdict == Decision.PASS
    [found] = completions(result)
    assert found["units"] == 64
    note = "it broke down in 0 of 64 runs, the champion in 0; a rate of breakdowns above 4.9 % is ruled out"
    assert found["note"] == note
    for page in ("index.html", "gate.json", "gate.md"):
        assert note in (result.folder / page).read_text()


def test_who_breaks_down_often_fails(tmp_path: Path) -> None:
    result = gated(tmp_path, "old", "fragile-30")
    assert result.verdict == Decision.FAIL
    assert completions(result)[0]["verdict"] == "fail"


def test_equals_that_both_break_down_cannot_be_judged(tmp_path: Path) -> None:
    result = gated(tmp_path, "brittle-20", "a-20", "b-20", "c-20")
    for candidate, found in zip(result.report.candidates, completions(result), strict=True):
        assert candidate.verdict == Decision.CANNOT_TELL
        assert "cannot be judged by a champion that breaks down itself" in str(found["note"])
    for laps in result.findings.filter(measure="lap time").to_dicts():
        assert "runs are not compared" in laps["note"]
        assert abs(laps["difference"]) < 0.5


def test_the_terminal_says_it_and_the_exit_code_is_four(tmp_path: Path) -> None:
    for name in ("fragile-20", "brittle-20"):
        (tmp_path / f"{name}.onnx").write_text(name)
    done = command(
        "gate", "fragile-20.onnx", "--champion", "brittle-20.onnx", "--config", configuration(tmp_path),
        "--out", "out", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 4
    assert "a champion that breaks down itself" in " ".join(done.stdout.split())


def test_too_small_a_budget_passes_nobody(tmp_path: Path) -> None:
    result = gated(tmp_path, "old", "other", runs=62)
    assert result.verdict == Decision.CANNOT_TELL
    assert "fewer than 63 runs cannot rule out 5 %" in str(completions(result)[0]["note"])
