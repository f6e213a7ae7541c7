"""The training curves of the checkpoints of a selection."""

from __future__ import annotations

from pathlib import Path

import polars as pl
import pytest

from nathlon.arena.results import CURVES, ENTRANTS
from nathlon.arena.store import Store
from nathlon.policies.bundled import BUNDLED
from nathlon.selection.publish.curves import find_curves, keep_curves

HEADER = "updates,transitions,wall_s,lap_s,off_course_share,mean_q,entropy\n"


def test_a_runs_curve_lies_beside_its_checkpoints_or_above(tmp_path: Path) -> None:
    for run, text in (("one", "4000,89641,475,nan,0.95,17.2,-6.3\n"), ("two", "4000,8,4,101.5,0,1,2\n")):
        (tmp_path / run / "checkpoints").mkdir(parents=True)
        (tmp_path / run / "curve.csv").write_text(HEADER + text)
    sources = [tmp_path / "one" / "checkpoints" / "a.safetensors", tmp_path / "two" / "b.safetensors"]
    curves = find_curves(map(str, [*sources, sources[0].with_name("c.safetensors")]))
    assert curves.schema == CURVES
    assert curves["checkpoints"].to_list() == [f"{tmp_path}/one/", f"{tmp_path}/two/"]
    assert curves["lap_s"].to_list() == [None, 101.5]
    assert all(
        str(path).startswith(start) for path, start in zip(sources, curves["checkpoints"], strict=True)
    )


def test_bundled_checkpoints_have_the_curves_of_their_own_runs() -> None:
    sources = sorted(map(str, (BUNDLED / "lindenring").glob("*.safetensors")))
    curves = find_curves(sources)
    runs = {start.rpartition("/")[2] for start in curves["checkpoints"]}
    assert runs == {f"{Path(source).stem.rpartition('-')[0]}-" for source in sources}
    for source in sources:
        assert sum(source.startswith(start) for start in curves["checkpoints"].unique()) == 1


def test_what_is_no_curve_is_passed_over(tmp_path: Path) -> None:
    for folder, text in (("a", ""), ("b", "updates,lap_s\n1,2\n"), ("c", HEADER + "x,y,z,1,2,3,4\n")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "curve.csv").write_text(text)
    (tmp_path / "d" / "curve.csv").mkdir(parents=True)
    assert find_curves(str(tmp_path / folder / "x.safetensors") for folder in "abcd").is_empty()


def test_paths_may_start_from_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("curve.csv").write_text(HEADER + "4000,8,4,101.5,0,1,2\n")
    assert find_curves(["checkpoints/a.safetensors"])["checkpoints"].to_list() == [""]
    assert find_curves(["driver:pace=0.95", "plugin:mine"]).is_empty()


def test_curves_stay_as_they_were_in_the_night(tmp_path: Path) -> None:
    (tmp_path / "curve.csv").write_text(HEADER + "4000,8,4,101.5,0,1,2\n")
    card = {"entrant": "a", "source": str(tmp_path / "a.safetensors")}
    with Store(tmp_path / "store.sqlite") as store:
        store.begin_run("night-0001", {})
        store.put_table("night-0001", "entrants", pl.DataFrame([card], schema=ENTRANTS))
        keep_curves(store, "night-0001")
        (tmp_path / "curve.csv").unlink()
        keep_curves(store, "night-0001")
        assert store.table("night-0001", "curves")["updates"].to_list() == [4000]
