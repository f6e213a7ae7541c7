"""Ablations: variants of a configuration, going on after a stop, folders refused, table and figure."""

from __future__ import annotations

import csv
import json
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from PIL import Image
from scipy.stats import ttest_1samp, ttest_ind

from nathlon.arena.store import Store
from nathlon.commands.ablate import ablate
from nathlon.judge.ablation import effects
from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.training.ablation import VARIANTS, claim, configurations, plan
from nathlon.policies.training.config import TrainingConfig, read_config
from nathlon.policies.training.log import Status
from nathlon.reports.ablation import ABLATION, EFFECTS, last_checkpoints, seed_band
from nathlon.sim.errors import InputError
from tests.support.command_line import nathlon, refused
from tests.support.trainings import CHECKPOINTS, TOML

pytestmark = pytest.mark.takes_long

CHOSEN = ("no-quantiles", "no-course-points")
SEEDS = 2


@pytest.fixture(scope="module")
def toml(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("configuration") / "small.toml"
    path.write_text(TOML)
    return path


@pytest.fixture(scope="module")
def base(toml: Path) -> TrainingConfig:
    return read_config(toml)


def leaves(config: TrainingConfig) -> dict[str, Any]:
    """All values of a configuration by their dotted names."""

    def walk(name: str, value: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(value, dict):
            for key, inner in value.items():
                yield from walk(f"{name}.{key}", inner)
        else:
            yield name[1:], value

    return dict(walk("", config.model_dump()))


@pytest.mark.parametrize(
    ("variant", "field", "value"),
    [
        ("no-quantiles", "qrsac.distributional", False),
        ("n-step-1", "qrsac.n_step", 1),
        ("n-step-3", "qrsac.n_step", 3),
        ("n-step-7", "qrsac.n_step", 7),
        ("one-table", "tables", "one"),
        ("no-passing-reward", "reward.passing", 0.0),
        ("no-course-points", "observation.course_points", 0),
        ("float32", "qrsac.precision", "float32"),
    ],
)
def test_a_variant_changes_one_field(base: TrainingConfig, variant: str, field: str, value: Any) -> None:
    changed = leaves(VARIANTS[variant](base))
    differing = {name: now for name, now in changed.items() if now != leaves(base)[name]}
    assert differing == {field: value}
    TrainingConfig.model_validate(VARIANTS[variant](base).model_dump())


def test_without_skill_scenarios_the_races_stay(base: TrainingConfig) -> None:
    left = VARIANTS["no-skill-scenarios"](base)
    assert left.rollouts == base.rollouts[:1]
    duel = base.rollouts[0].model_copy(update={"scenario": "1v1"})
    shared = [
        rollouts.model_copy(update={"share": share})
        for rollouts, share in zip((*base.rollouts, duel), (0.2, 0.5, 0.3), strict=True)
    ]
    left = VARIANTS["no-skill-scenarios"](base.model_copy(update={"rollouts": tuple(shared)}))
    assert [rollouts.scenario for rollouts in left.rollouts] == ["1v0", "1v1"]
    assert left.shares == pytest.approx([0.4, 0.6])
    skills = base.model_copy(update={"rollouts": base.rollouts[1:]})
    with pytest.raises(InputError, match="no rollouts are left"):
        configurations(skills, ["no-skill-scenarios"])


def test_variants_that_are_the_base_are_left_out(base: TrainingConfig) -> None:
    assert list(configurations(base, VARIANTS)) == [
        "base",
        *(name for name in VARIANTS if name != "n-step-5"),
    ]
    alone = base.model_copy(update={"rollouts": base.rollouts[:1]})
    assert list(configurations(alone, ["one-table", "no-skill-scenarios", "n-step-1"])) == [
        "base",
        "n-step-1",
    ]


def test_all_variants_come_with_the_first_seed_first(base: TrainingConfig) -> None:
    runs = plan(configurations(base, ["n-step-1"]), 2, Path("out"))
    assert [(run.variant, run.seed) for run in runs] == [
        ("base", 1),
        ("n-step-1", 1),
        ("base", 2),
        ("n-step-1", 2),
    ]
    assert runs[-1].folder == Path("out/n-step-1/seed-2")


def test_a_folder_of_another_configuration_is_refused(base: TrainingConfig, tmp_path: Path) -> None:
    claim(tmp_path / "out", base)
    claim(tmp_path / "out", base)
    with pytest.raises(InputError, match="another configuration, which differs in updates"):
        claim(tmp_path / "out", base.model_copy(update={"updates": 8}))
    (tmp_path / "out" / "ablation.json").write_text("{")
    with pytest.raises(InputError, match=r"ablation\.json"):
        claim(tmp_path / "out", base)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be read or written"):
        claim(tmp_path / "file", base)


def test_a_run_of_another_seed_is_not_taken_over(base: TrainingConfig, tmp_path: Path) -> None:
    first, second = plan({"base": base}, 2, tmp_path)
    first.trainer()
    first.folder.rename(second.folder)
    with pytest.raises(InputError, match="another training run"):
        second.trainer()


def test_bad_input_is_one_sentence(toml: Path, tmp_path: Path) -> None:
    refused(nathlon("ablate", toml, "--variant", "no-wheels", cwd=tmp_path), "no-wheels", "no-quantiles")
    with pytest.raises(InputError, match="updates is 1, expected at least the 2"):
        ablate(str(toml), tmp_path / "out", 1, 1, [], 0, 1)
    assert not list(tmp_path.iterdir())


def modified(out: Path) -> dict[Path, int]:
    """When each checkpoint was written."""
    return {path: path.stat().st_mtime_ns for path in out.rglob("step-*.safetensors")}


@pytest.fixture(scope="module")
def ablation(toml: Path, base: TrainingConfig, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder of an ablation that was stopped in its second run, and went on; what it then printed."""
    out = tmp_path_factory.mktemp("ablation")
    first, second = plan(configurations(base, CHOSEN), SEEDS, out)[:2]
    first.trainer().run(lambda status: None)
    assert first.finished

    def stop(status: Status) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        second.trainer().run(stop)
    assert not second.finished
    before = modified(out)
    with redirect_stdout(StringIO()) as printed:
        ablate(str(toml), out, SEEDS, None, list(CHOSEN), 1, 1)
    after = modified(out)
    assert {path: after[path] for path in before} == before
    assert len(after) == (1 + len(CHOSEN)) * SEEDS * len(CHECKPOINTS)
    return out, printed.getvalue()


@pytest.fixture(scope="module")
def out(ablation: tuple[Path, str]) -> Path:
    return ablation[0]


def test_the_table_has_a_row_for_each_checkpoint(out: Path) -> None:
    rows = list(csv.DictReader((out / "ablation.csv").open()))
    assert list(rows[0]) == list(ABLATION)
    seen = {(row["variant"], int(row["seed"]), int(row["updates"])) for row in rows}
    names = ("base", *CHOSEN)
    assert len(rows) == len(seen)
    assert seen == {(name, seed, step) for name in names for seed in (1, 2) for step in CHECKPOINTS}
    own = list(csv.DictReader((out / "no-quantiles" / "seed-2" / "curve.csv").open()))
    mine = [row for row in rows if (row["variant"], row["seed"]) == ("no-quantiles", "2")]
    for row, wanted in zip(mine, own, strict=True):
        assert float(row["off_course_share"]) == float(wanted["off_course_share"])
        assert row["transitions"] == wanted["transitions"]
        assert (row["lap_s"] == "") == math.isnan(float(wanted["lap_s"]))


def test_variants_race_the_base_with_their_last_checkpoints(out: Path) -> None:
    rows = list(csv.DictReader((out / "ablation.csv").open()))
    raced = [row for row in rows if row["score_difference"]]
    assert [(row["variant"], row["updates"]) for row in raced] == [(name, "4") for name in CHOSEN * SEEDS]
    with Store.open(out / "store.sqlite") as store:
        results = store.results()
    for row in raced:
        path = out / row["variant"] / f"seed-{row['seed']}" / "checkpoints" / "step-0000004.safetensors"
        mine = pl.col("entrant") == load_checkpoint(path).id
        match = results.filter(mine.any().over("match"))
        assert match.select("race", "car").n_unique() == match.height == 16
        own, other = (
            match.filter(side).select("points", "contacts", "distance_m").sum() for side in (mine, ~mine)
        )
        assert float(row["score_difference"]) == pytest.approx((own - other)["points"].item() / 2)
        assert float(row["contacts_per_km"]) == pytest.approx(
            1000 * own["contacts"].item() / own["distance_m"].item()
        )


def test_a_policy_without_course_points_sees_none(out: Path) -> None:
    path = out / "no-course-points" / "seed-1" / "checkpoints" / "step-0000004.safetensors"
    assert load_checkpoint(path).observation_spec.size == 31 + 2 * 7


def test_the_figure_names_every_variant(out: Path) -> None:
    ET.parse(out / "ablation.svg")
    with Image.open(out / "ablation.png") as picture:
        assert min(picture.size) > 500
        assert len(picture.convert("RGB").getcolors(1 << 20) or []) > 10


def test_the_same_command_again_trains_nothing_and_has_the_same_to_tell(
    toml: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, figure = modified(out), (out / "ablation.svg").read_bytes()
    written = pl.read_csv(out / "effects.csv", schema_overrides=EFFECTS)
    ablate(str(toml), out, SEEDS, None, list(CHOSEN), 1, 1, as_json=True)
    assert json.loads(capsys.readouterr().out)["differences"] == written.to_dicts()
    assert modified(out) == before
    assert (out / "ablation.svg").read_bytes() == figure


def test_runs_that_diverge_do_not_stop_the_others(toml: Path, tmp_path: Path) -> None:
    config = tmp_path / "steep.toml"
    config.write_text(toml.read_text() + "progress = 1e300\n")
    with pytest.raises(InputError, match="2 of 2 runs diverged"):
        ablate(str(config), tmp_path / "out", 1, None, ["n-step-1"], 0, 1)
    assert pl.read_csv(tmp_path / "out" / "ablation.csv").columns == list(ABLATION)
    assert (tmp_path / "out" / "ablation.svg").exists()


def test_a_seed_without_a_lap_is_the_slowest() -> None:
    laps = {2: (100.0, 90.0, None), 4: (80.0, 70.0, 75.0), 6: (None, None, 60.0)}
    rows = [
        {"variant": variant, "seed": seed, "updates": updates, "lap_s": lap}
        for variant in ("base", "other")
        for updates, drawn in laps.items()
        for seed, lap in enumerate(drawn)
        if (variant, updates) != ("other", 6)
    ]
    table = pl.DataFrame(rows, schema_overrides=ABLATION)
    band = seed_band(table, "base")
    assert band["updates"].to_list() == [2, 4, 6]
    assert band["low"].to_list() == [90.0, 70.0, 60.0]
    assert band["median"].to_list() == [100.0, 75.0, math.inf]
    assert band["high"].to_list() == [math.inf, 80.0, math.inf]
    last = last_checkpoints(table)
    assert last["updates"].to_list() == [6, 6, 6, 4, 4, 4]
    assert last["lap_s"].to_list() == [None, None, 60.0, 80.0, 70.0, 75.0]


Laps = Sequence[float | None]


def last_laps(laps: dict[str, Laps], scores: Sequence[float] = ()) -> pl.DataFrame:
    """ABLATION of runs with two checkpoints each, the last ones with these laps, and scores of `other`."""
    scored = {("other", seed, 4): score for seed, score in enumerate(scores)}
    rows = [
        {
            "variant": variant,
            "seed": seed,
            "updates": updates,
            "lap_s": lap if updates == 4 else 200.0,
            "score_difference": scored.get((variant, seed, updates)),
        }
        for variant, seeds in laps.items()
        for seed, lap in enumerate(seeds)
        for updates in (2, 4)
    ]
    return pl.DataFrame(rows, schema=ABLATION)


def test_differences_have_the_intervals_of_welch_and_student() -> None:
    base, other, scores = [100.0, 101.0, 103.0], [99.0, 98.5, 100.5, 97.0], [3.0, -1.0, 2.0, 2.5]
    found = effects(last_laps({"base": base, "other": other}, scores))
    assert found.schema == EFFECTS
    assert found["variant"].to_list() == ["other", "other"]
    assert found["measure"].to_list() == ["lap_s", "score_difference"]
    assert found["seeds"].to_list() == [4, 4]
    lap, score = found.select("difference", "low", "high").rows()
    welch = ttest_ind(other, base, equal_var=False).confidence_interval(0.95)
    assert lap == pytest.approx((sum(other) / 4 - sum(base) / 3, welch.low, welch.high))
    student = ttest_1samp(scores, 0.0).confidence_interval(0.95)
    assert score == pytest.approx((sum(scores) / 4, student.low, student.high))


@pytest.mark.parametrize(
    ("base", "other"),
    [([100.0, 101.0], [99.0]), ([100.0], [99.0, 99.5]), ([100.0, 100.0], [99.0, 99.5])],
)
def test_a_single_seed_has_no_interval_nor_seeds_that_are_alike(base: Laps, other: Laps) -> None:
    (row,) = effects(last_laps({"base": base, "other": other}, [1.0])).filter(measure="lap_s").to_dicts()
    assert row["difference"] < 0.0
    assert (row["seeds"], row["low"], row["high"]) == (len(other), None, None)


@pytest.mark.parametrize(("base", "other"), [([100.0, None], [99.0, 98.0]), ([100.0, 99.0], [None, 98.0])])
def test_a_seed_without_a_lap_leaves_no_difference(
    base: list[float | None], other: list[float | None]
) -> None:
    (row,) = effects(last_laps({"base": base, "other": other})).to_dicts()
    assert (row["seeds"], row["difference"], row["low"], row["high"]) == (2, None, None, None)


def test_the_differences_are_written_and_printed(ablation: tuple[Path, str]) -> None:
    out, printed = ablation
    written = pl.read_csv(out / "effects.csv", schema_overrides=EFFECTS)
    assert written["variant"].to_list() == [name for name in CHOSEN for _ in range(2)]
    assert all(name in printed for name in CHOSEN)
