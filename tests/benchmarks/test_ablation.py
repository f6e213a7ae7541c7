"""Which policies of an ablation meet, and how sure their differences are."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from benchmarks import ablation
from nathlon.policies.training.ablation import AblationRun
from tests.support.checkpoints import BUNDLED


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(ablation, "RUNS", tmp_path)
    return tmp_path


def leave(run: AblationRun, source: Path) -> None:
    for name in ablation.LEFT:
        (run.folder / name).parent.mkdir(parents=True, exist_ok=True)
    (run.folder / "curve.csv").write_text("updates,lap_s,off_course_share\n4,nan,0.5\n8,100.5,0.25\n")
    shutil.copy(source, run.folder / ablation.LEFT[1])


def test_each_variant_meets_the_base_of_its_seed(kept: Path) -> None:
    runs = {str(run): run for run in ablation.runs(kept)}
    assert len(runs) == (1 + len(ablation.VARIANTS)) * ablation.SEEDS
    for name, source in (("base, seed 1", 0), ("n-step-1, seed 1", 1), ("n-step-1, seed 2", 2)):
        leave(runs[name], BUNDLED[source])
    [duel] = ablation.duels(3)
    assert str(duel.run) == "n-step-1, seed 1"
    assert len(duel.match.races) == 6
    assert len(duel.match.entrants) == 2
    assert {len(race.seats) for race in duel.match.races} == {8}
    last = ablation.training_end([runs["base, seed 1"], duel.run])
    assert last == {"lap_s": 100.5, "off_course_share": 0.25}


def test_intervals_over_seeds_are_student_s() -> None:
    values = [1.0, -2.5, 4.0]
    expected = stats.t.interval(0.95, 2, np.mean(values), stats.sem(values))
    assert ablation.t_interval(values) == pytest.approx(expected)
    assert ablation.t_interval(values[:1]) is None
