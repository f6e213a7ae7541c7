"""Who takes part: entrants from files of every kind."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import onnx
import pytest
from onnx import helper

import nathlon
from nathlon.arena.entrance import enter_all, enter_found, trained_on
from nathlon.arena.entrant import entrants_table
from nathlon.arena.pool import Pool
from nathlon.policies.checkpoint import load_checkpoint
from nathlon.policies.sources.finding import find, find_sources
from nathlon.policies.sources.onnx import export_onnx
from nathlon.sim.errors import InputError
from tests.support.checkpoints import BUNDLED

POLISHED, TRAINED = (
    BUNDLED[0].with_name(f"lindenring-{name}.safetensors") for name in ("again-056k", "wake-028k")
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two checkpoints, the state of a training run, and an ONNX graph that does not tell its circuit."""
    (tmp_path / "run").mkdir()
    shutil.copy(POLISHED, tmp_path / "b.safetensors")
    shutil.copy(TRAINED, tmp_path / "run" / "step.safetensors")
    for name in ("state", "replay"):
        (tmp_path / "run" / f"{name}.safetensors").write_bytes(b"no policy")
    (tmp_path / "notes.txt").write_text("no policy")
    export_onnx(load_checkpoint(POLISHED), tmp_path / "a.onnx")
    model = onnx.load(tmp_path / "a.onnx")
    del model.metadata_props[:]
    card = {"observation": load_checkpoint(POLISHED).observation_spec.to_dict()}
    helper.set_model_props(model, {"nathlon": json.dumps(card)})
    onnx.save(model, tmp_path / "a.onnx")
    return tmp_path


def test_a_folder_stands_for_all_policies_below_it(folder: Path) -> None:
    (folder / "c.zip").write_bytes(b"no policy")
    found = [Path(source).relative_to(folder).as_posix() for source in find_sources([folder])]
    assert found == ["a.onnx", "b.safetensors", "c.zip", "run/step.safetensors"]
    (folder / "empty").mkdir()
    with pytest.raises(InputError, match=r"empty: holds no checkpoint"):
        find_sources([folder / "empty"])


def test_links_are_followed_what_is_hidden_is_not_and_capitals_do_not_matter(
    folder: Path, pool: Pool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    shutil.copy(folder / "b.safetensors", elsewhere / "LAST.SAFETENSORS")
    shutil.copy(folder / "a.onnx", elsewhere / "GRAPH.ONNX")
    (elsewhere / "STATE.SAFETENSORS").write_bytes(b"no policy")
    (elsewhere / "round").symlink_to(folder)
    (folder / "run" / "linked").symlink_to(elsewhere)
    (folder / "latest").symlink_to(folder / "run")
    (folder / ".cache").mkdir()
    for hidden in (".cache/c.zip", "._b.safetensors"):
        (folder / hidden).write_bytes(b"no policy")
    found = find_sources([folder])
    assert [Path(source).relative_to(folder).as_posix() for source in found] == [
        "a.onnx",
        "b.safetensors",
        "run/linked/GRAPH.ONNX",
        "run/linked/LAST.SAFETENSORS",
        "run/step.safetensors",
    ]
    shouted = enter_all(pool, found[2:4], "lindenring", "gt3")
    assert [entrant.algorithm for entrant in shouted] == ["ONNX", "QR-SAC, polished"]
    assert find_sources([folder / ".cache"]) == [str(folder / ".cache" / "c.zip")]


def test_what_cannot_be_read_is_named_together(
    folder: Path, pool: Pool, caplog: pytest.LogCaptureFixture
) -> None:
    """In a folder it is set aside; what is named itself is refused."""
    (folder / "link.onnx").symlink_to(folder / "nowhere.onnx")
    os.mkfifo(folder / "pipe.zip")
    (folder / "large.safetensors").write_text(
        f"version https://git-lfs.github.com/spec/v1\noid sha256:{'0' * 64}\nsize 7\n"
    )
    reasons = {
        "link.onnx": "No such file",
        "pipe.zip": "a pipe or a device",
        "large.safetensors": "git-lfs pointer, expected a policy: run git lfs pull",
    }
    assert [Path(source).name for source in find_sources([folder])] == [
        "a.onnx",
        "b.safetensors",
        "step.safetensors",
    ]
    [said] = [record.getMessage() for record in caplog.records]
    assert nathlon.plan(folder).stages[0].entrants == 3
    shutil.copy(folder / "b.safetensors", folder / "same.safetensors")
    assert nathlon.plan(folder).stages[0].entrants == 3, "files with the same contents are one entrant"
    with pytest.raises(InputError) as caught:
        find_sources([folder / "b.safetensors", "nobody.onnx", *(folder / name for name in reasons)])
    assert str(caught.value).startswith("4 cannot be used: nobody.onnx: no such file")
    for sentence in (said, str(caught.value)):
        assert "\n" not in sentence
        for name, reason in reasons.items():
            assert str(folder / name) in sentence
            assert reason.lower() in sentence.lower()
    for name in ("one.onnx", "two.onnx"):
        (folder / name).write_bytes(b"no policy")
    with pytest.raises(InputError, match=r"2 cannot be used: .*one\.onnx: .*; .*two\.onnx: "):
        enter_all(pool, find_sources([folder]), "lindenring", "gt3")
    entrants, aside = enter_found(pool, find([folder, folder / "b.safetensors"]), "lindenring", "gt3")
    assert [entrant.name for entrant in entrants] == ["a", "b", "step"]
    assert {Path(source).name for source in aside} == {*reasons, "one.onnx", "two.onnx"}
    with pytest.raises(InputError, match=r"^[^;]*one\.onnx: [^;]*$"):
        enter_found(pool, find([folder, folder / "one.onnx"]), "lindenring", "gt3")
    for path in (folder / "a.onnx", folder / "b.safetensors", folder / "same.safetensors"):
        path.unlink()
    shutil.rmtree(folder / "run")
    with pytest.raises(InputError, match=r"2 cannot be used: .*one\.onnx: .*; .*two\.onnx: "):
        enter_found(pool, find([folder]), "lindenring", "gt3")


def test_the_generalist_is_entered_by_its_name_for_any_circuit_and_car(pool: Pool) -> None:
    sources = find_sources(["generalist", "driver"])
    assert load_checkpoint(Path(sources[0])).card.circuit == "any"
    assert trained_on(pool, sources) == ("lindenring", "gt3")
    [entrant, _] = enter_all(pool, sources, "porto-sereno", "prototype")
    assert entrant.name.startswith("generalist-")
    assert (entrant.circuit, entrant.car) == ("porto-sereno", "prototype")


def test_circuit_and_car_are_those_of_the_first_that_tells_them(folder: Path, pool: Pool) -> None:
    sources = [str(folder / "a.onnx"), str(folder / "b.safetensors")]
    assert trained_on(pool, ["plugin:any", "driver", *sources]) == ("lindenring", "gt3")
    card = load_checkpoint(folder / "b.safetensors").card
    assert trained_on(pool, sources) == (card.circuit, card.car)
    assert trained_on(pool, sources[:1]) == ("lindenring", "gt3")


def test_files_of_every_kind_stand_in_one_table(folder: Path, pool: Pool) -> None:
    sources = [str(path) for path in find_sources([folder])]
    table = entrants_table(enter_all(pool, sources, "lindenring", "gt3"))
    assert table["name"].to_list() == ["a", "b", "step"]
    assert table["algorithm"].to_list() == ["ONNX", "QR-SAC, polished", "QR-SAC"]
    assert table["step"].null_count() == 1
