"""The time to learn: what a curve says, when a run ends, and going on with a measurement."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from benchmarks.learning import Learning, Outcome, configurations, learn, measure, outcome, read, write
from benchmarks.result import write_result
from nathlon.policies.training import trainer
from nathlon.policies.training.config import TrainingConfig
from nathlon.policies.training.log import CURVE, CURVE_FILE
from nathlon.policies.training.trainer import Trainer
from nathlon.sim.errors import InputError

TINY = TrainingConfig.model_validate(
    {
        "circuit": "lindenring",
        "car": "gt3",
        "updates": 40,
        "updates_per_step": 5,
        "warm_up": 60,
        "replay": 500,
        "checkpoint_every": 10,
        "rollouts": [{"scenario": "1v0", "races": 3, "learners": 1}],
        "observation": {"course_points": 3, "cars_ahead": 0, "cars_behind": 0},
        "qrsac": {"hidden": [8, 8], "quantiles": 4, "batch": 16, "n_step": 3},
    }
)
NEVER_S, SHORT_S = 0.0, 0.0


@pytest.fixture(autouse=True)
def told_at_every_checkpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trainer, "LOG_EVERY", 10)


def curve(folder: Path, *rows: tuple[int, int, str, float]) -> Path:
    """A run's folder with a curve of these updates, wall times, laps and shares off course."""
    lines = [",".join(CURVE)] + [f"{n},{n},{wall},{lap},{off},0.0,0.0" for n, wall, lap, off in rows]
    (folder / CURVE_FILE).write_text("\n".join(lines))
    return folder


def test_the_first_lap_as_fast_and_clean_is_what_counts(tmp_path: Path) -> None:
    run = curve(
        tmp_path,
        (100, 60, "nan", 0.3),
        (200, 120, "109.0", 0.02),
        (300, 180, "111.0", 0.0),
        (400, 240, "110.0", 0.009),
        (500, 300, "105.0", 0.0),
    )
    assert outcome(run, 110.0) == Outcome(
        reached=True, wall_s=240, updates=400, lap_s=110.0, off_course_share=0.009
    )
    assert outcome(run, 100.0) == Outcome(
        reached=False, wall_s=300, updates=500, lap_s=105.0, off_course_share=0.0
    )


def test_a_run_without_any_lap_has_not_arrived(tmp_path: Path) -> None:
    assert outcome(tmp_path, 110.0) is None
    came = outcome(curve(tmp_path, (100, 60, "nan", 0.3)), 110.0)
    assert came
    assert not came.reached
    assert came.lap_s is None


def test_a_run_ends_with_its_configuration_or_at_the_time_limit(tmp_path: Path) -> None:
    limited = learn(tmp_path / "limited", TINY, 1, NEVER_S, SHORT_S)
    assert not limited.reached
    assert limited.updates == 10
    # The same folder with more time: it goes on to the end.
    whole = learn(tmp_path / "limited", TINY, 1, NEVER_S, 3600.0)
    assert not whole.reached
    assert whole.updates == 40
    assert whole.wall_s >= limited.wall_s


def test_a_folder_of_another_configuration_is_not_gone_on_with(tmp_path: Path) -> None:
    Trainer.start(tmp_path, TINY, 1)
    with pytest.raises(InputError, match="another configuration"):
        learn(tmp_path, TINY.model_copy(update={"updates": 2000}), 1, NEVER_S, SHORT_S)


def test_seeds_that_are_done_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "learning.json"
    done = Outcome(reached=True, wall_s=900.0, updates=500, lap_s=100.0, off_course_share=0.0)
    so_far = Learning(car="gt3", cores=2, driver_lap_s=NEVER_S, configuration=TINY, seeds={1: done})
    write(path, {"lindenring": so_far})
    measured = measure(path, {"lindenring": TINY}, 2, SHORT_S)["lindenring"]
    assert measured.seeds[1] == done
    assert measured.seeds[2].updates == 10
    assert read(path)["lindenring"] == measured
    shutil.rmtree(tmp_path / "learning")
    assert measure(path, {"lindenring": TINY}, 2, SHORT_S)["lindenring"] == measured
    with pytest.raises(InputError, match="another configuration"):
        measure(path, {"lindenring": TINY.model_copy(update={"updates": 2000})}, 2, SHORT_S)


def test_a_run_without_success_is_the_slowest() -> None:
    def learning(*walls: float | None) -> Learning:
        seeds = {
            seed: Outcome(
                reached=wall is not None, wall_s=wall or 1.0, updates=1, lap_s=None, off_course_share=0.0
            )
            for seed, wall in enumerate(walls)
        }
        return Learning(car="gt3", cores=2, driver_lap_s=100.0, configuration=TINY, seeds=seeds)

    assert learning(30.0, 10.0, 20.0).median_wall_s == 20.0
    assert learning(30.0, None, 20.0).median_wall_s == 30.0
    assert learning(30.0, None, None).median_wall_s is None
    assert learning().median_wall_s is None


def test_every_circuit_has_one_configuration_alone() -> None:
    configs = configurations([])
    assert {"lindenring", "porto-sereno", "grandes-landes"} <= set(configs)
    with pytest.raises(InputError, match="circuit monza: no time-trial configuration"):
        configurations(["monza"])


def test_a_file_of_something_else_is_bad_input(tmp_path: Path) -> None:
    write_result(tmp_path / "other.json", {"lindenring": {"gt3": 1}})
    with pytest.raises(InputError, match=r"other\.json: field lindenring\.car"):
        read(tmp_path / "other.json")
