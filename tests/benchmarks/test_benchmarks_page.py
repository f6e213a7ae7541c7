"""The page of current figures is what the committed results give."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks import page
from benchmarks.page import PAGE, pooled
from benchmarks.result import RESULTS, Result, read_result, write_result
from nathlon.sim.errors import InputError


def all_results() -> dict[str, Result]:
    return {path.stem: read_result(path) for path in RESULTS.glob("*.json")}


def test_the_page_is_what_the_results_give(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["page", "--check"])
    page.main()


def test_a_page_that_lags_behind_its_results_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stale = tmp_path / "benchmarks.md"
    passed = all_results()["tests"].figures["passed"]
    now = PAGE.read_text("utf-8")
    stale.write_text(now.replace(f"{passed:,}", f"{passed + 1:,}"), "utf-8")
    assert stale.read_text("utf-8") != now
    monkeypatch.setattr(page, "PAGE", stale)
    monkeypatch.setattr("sys.argv", ["page", "--check"])
    with pytest.raises(SystemExit, match="1"):
        page.main()
    assert "python -m benchmarks.page" in capsys.readouterr().err


def test_a_figure_that_changes_is_a_verdict_that_changes() -> None:
    results = all_results()
    slow = results["pareto"].model_copy(update={"figures": {**results["pareto"].figures, "wall_s": 601}})
    made = page.page({**results, "pareto": slow})
    assert "| 601 |" in made
    assert "A thousand checkpoints in ten minutes on two cores: missed." in made
    assert "A thousand checkpoints in ten minutes on two cores: reached." in page.page(results)


def test_wins_are_summed_over_runs() -> None:
    def came(wins: int) -> dict[str, float]:
        return {"wins": wins, "mean_place": 1.0}

    runs = [
        {
            "lindenring": {
                "gt3": {
                    "champions": {
                        "a": {
                            "races": 10 * times,
                            "wins_from_back": times,
                            "by_pace": {"0.95": came(2 * times)},
                            "seven_laps": {"1.0": came(3 * times), "0.95": came(4 * times)},
                        }
                    }
                }
            }
        }
        for times in (1, 10)
    ]
    assert pooled(runs, "lindenring", "gt3", "a") == {
        "races": 110,
        "7 at 1.0": 33,
        "7 at 0.95": 44,
        "2 at 1.0": 11,
        "2 at 0.95": 22,
    }


def test_a_result_tells_where_its_figures_come_from(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["world", "--json", "out file.json"])
    path = tmp_path / "deep" / "world.json"
    write_result(path, {"figure": 1.5}, {"casadi": "3.7"})
    result = read_result(path)
    assert result.figures == {"figure": 1.5}
    assert result.source == "benchmark"
    assert result.versions["casadi"] == "3.7"
    assert {"python", "numpy", "numba"} <= set(result.versions)
    assert result.command.endswith("--json 'out file.json'")
    assert result.machine
    assert list(path.parent.iterdir()) == [path]


def test_a_result_without_a_machine_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "world.json"
    path.write_text(json.dumps({"command": "", "date": "", "versions": {}, "figures": 1}))
    with pytest.raises(InputError, match=r"world\.json: field machine"):
        read_result(path)


def test_verdicts_are_counted_over_worlds_and_runs() -> None:
    same, win = (
        {"verdict": "same"},
        {"verdict": "win", "difference": 0.5, "low": 0.1, "high": 0.9, "steps": 2000},
    )
    worlds = {"a": {"1": {"last": win}, "2": {"last": same}}, "b": {"1": {"last": win}}}
    assert page.tally(worlds, "last") == "2 won, 0 tied, 0 lost, 1 the same checkpoint"
    assert page.less(win) == "+0.50 (+0.10 to +0.90), step 2,000"
    assert page.less(same) == ""


def test_a_calibration_that_misses_a_goal_says_so() -> None:
    results = all_results()
    figures = results["calibration"].figures
    worse = figures["finalists"]["2"] | {"false_accept": 0.06}
    bad = {**figures, "finalists": {**figures["finalists"], "2": worse}}
    made = page.page({**results, "calibration": results["calibration"].model_copy(update={"figures": bad})})
    assert "at most 5 % false ranks: missed (6.0 % at most)" in made


def test_a_difference_is_shown_with_its_sign_and_interval() -> None:
    over = {"points": -0.64, "points_low": -1.47, "points_high": 0.19}
    assert page.signed(over, "points", 1) == "-0.6 (-1.5 to +0.2)"
