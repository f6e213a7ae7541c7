"""Which checkpoints are new, and which files are set aside."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import pytest
from onnx import TensorProto, helper

from nathlon.arena.entrant import enter, entrants_table
from nathlon.arena.pool import Pool
from nathlon.arena.store import Store
from nathlon.selection.field import EntryList
from nathlon.selection.nightly.newcomers import newcomers
from nathlon.selection.nightly.watching import watch
from nathlon.sim.errors import InputError
from nathlon.sim.names import as_named
from nathlon.sim.observation import ObservationSpec
from tests.support.checkpoints import BUNDLED

PAIR = ("lindenring", "gt3")


@pytest.fixture
def watched(tmp_path: Path) -> Path:
    """Two checkpoints of one name, one of them twice, and a file that is none."""
    for folder, source in (("a", BUNDLED[0]), ("b", BUNDLED[1]), ("c", BUNDLED[1])):
        (tmp_path / folder).mkdir()
        shutil.copy(source, tmp_path / folder / "step.safetensors")
    (tmp_path / "c" / "broken.safetensors").write_bytes(b"no checkpoint")
    return tmp_path


def test_the_same_contents_are_one_entrant_and_names_are_unique(watched: Path, pool: Pool) -> None:
    new, excluded = newcomers(pool, watch([str(watched)]), *PAIR, known={})
    assert {entrant.name: entrant.id for entrant in new} == {
        "a/step": enter(str(BUNDLED[0]), *PAIR).id,
        "b/step": enter(str(BUNDLED[1]), *PAIR).id,
    }
    assert [entrant.also for entrant in new] == [(), (str(watched / "c" / "step.safetensors"),)]
    assert [item.source for item in excluded] == [str(watched / "c" / "broken.safetensors")]
    assert "broken.safetensors" in excluded[0].reason


def test_what_is_known_or_was_refused_is_not_new(watched: Path, pool: Pool) -> None:
    new, excluded = newcomers(pool, watch([str(watched)]), *PAIR, known={})
    known = {entrant.id: entrant.name for entrant in new[:1]}
    again, nothing = newcomers(pool, watch([str(watched)]), *PAIR, known, {item.key for item in excluded})
    assert [entrant.id for entrant in again] == [new[1].id]
    assert not nothing
    (watched / "c" / "broken.safetensors").write_bytes(b"another")
    _, changed = newcomers(pool, watch([str(watched)]), *PAIR, known, {item.key for item in excluded})
    assert len(changed) == 1


def test_a_name_that_is_taken_on_an_earlier_night_is_not_given_again(watched: Path, pool: Pool) -> None:
    new, _ = newcomers(pool, watch([str(watched / "a")]), *PAIR, known={"another": "step"})
    assert new[0].name == "a/step"
    new, _ = newcomers(pool, watch([str(watched / "a")]), *PAIR, known={"another": "step", "third": "a/step"})
    assert new[0].name == f"a/step-{new[0].id[:6]}"


def test_another_circuit_is_set_aside(watched: Path, pool: Pool) -> None:
    new, excluded = newcomers(pool, watch([str(watched / "a")]), "porto-sereno", "coupe", known={})
    assert not new
    assert "circuit is 'lindenring', expected 'porto-sereno'" in excluded[0].reason


def test_an_empty_folder_holds_nothing_yet_and_a_missing_one_is_refused(tmp_path: Path, pool: Pool) -> None:
    assert newcomers(pool, watch([str(tmp_path)]), *PAIR, known={}) == ([], [])
    with pytest.raises(InputError, match="none: no such file or folder"):
        watch([str(tmp_path / "none")])


def test_what_is_no_regular_file_is_set_aside_unread_and_not_told_again(watched: Path, pool: Pool) -> None:
    """A pipe that nobody writes to would keep whoever reads it waiting for ever."""
    os.mkfifo(watched / "pipe.safetensors")
    (watched / "gone.onnx").symlink_to(watched / "nowhere")
    new, excluded = newcomers(pool, watch([str(watched)]), *PAIR, known={})
    assert len(new) == 2
    names = {Path(item.source).name: item for item in excluded}
    assert set(names) == {"broken.safetensors", "gone.onnx", "pipe.safetensors"}
    assert names["pipe.safetensors"].digest is None
    known = {entrant.id: entrant.name for entrant in new}
    assert newcomers(pool, watch([str(watched)]), *PAIR, known, {item.key for item in excluded}) == ([], [])


def test_an_endless_graph_is_set_aside_when_its_time_is_up(watched: Path) -> None:
    """It gives its actions after 2^62 rounds."""
    endless(watched / "endless.onnx")
    with Pool(1, first_answer_s=3.0) as pool:
        new, excluded = newcomers(pool, watch([str(watched)]), *PAIR, known={})
    assert len(new) == 2
    assert [item.reason for item in excluded if item.source.endswith("endless.onnx")] == [
        f"{watched}/endless.onnx: took more than 3 s to open, expected a policy"
    ]


def endless(path: Path) -> None:
    size = ObservationSpec().size
    body = helper.make_graph(
        [helper.make_node("Identity", ["go"], ["goes"]), helper.make_node("Identity", ["x"], ["y"])],
        "body",
        [
            helper.make_tensor_value_info("round", TensorProto.INT64, []),
            helper.make_tensor_value_info("go", TensorProto.BOOL, []),
            helper.make_tensor_value_info("x", TensorProto.FLOAT, ["n", 2]),
        ],
        [
            helper.make_tensor_value_info("goes", TensorProto.BOOL, []),
            helper.make_tensor_value_info("y", TensorProto.FLOAT, ["n", 2]),
        ],
    )
    graph = helper.make_graph(
        [
            helper.make_node("Slice", ["seen", "from", "to", "axis"], ["first"]),
            helper.make_node("Loop", ["rounds", "true", "first"], ["action"], body=body),
        ],
        "endless",
        [helper.make_tensor_value_info("seen", TensorProto.FLOAT, ["n", size])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["n", 2])],
        [
            helper.make_tensor("from", TensorProto.INT64, [1], [0]),
            helper.make_tensor("to", TensorProto.INT64, [1], [2]),
            helper.make_tensor("axis", TensorProto.INT64, [1], [1]),
            helper.make_tensor("rounds", TensorProto.INT64, [], [2**62]),
            helper.make_tensor("true", TensorProto.BOOL, [], [True]),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    path.write_bytes(model.SerializeToString())


def test_names_of_files_are_shown_as_they_can_be(watched: Path, pool: Pool) -> None:
    """In tables; they are kept as they are to open the files."""
    strange = Path(os.fsdecode(os.fsencode(watched) + b"/\xff.safetensors"))
    shutil.copy(BUNDLED[2], strange)
    shutil.copy(BUNDLED[3], watched / "two\nlines.safetensors")
    new, excluded = newcomers(pool, watch([str(watched)]), *PAIR, known={})
    assert {"two\\nlines", "\\udcff"} <= {entrant.name for entrant in new}
    assert str(strange) in {entrant.source for entrant in new}
    assert [Path(item.source).name for item in excluded] == ["broken.safetensors"]
    with Store(watched.parent / "store.sqlite") as store:
        store.begin_run("night", {"field": asdict(EntryList(tuple(new)))})
        assert EntryList.from_plan(store.runs()[0].config).newcomers == tuple(new)
        store.put_table("night", "entrants", entrants_table(new))
        sources = store.table("night", "entrants")["source"].to_list()
    assert f"{watched}/\\udcff.safetensors" in sources
    assert {as_named(source) for source in sources} == {entrant.source for entrant in new}


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody else")
def test_a_folder_that_cannot_be_looked_into_is_set_aside(watched: Path) -> None:
    (watched / "closed").mkdir(mode=0o700)
    script = (
        "import os, sys\nfrom pathlib import Path\n"
        "from nathlon.arena.entrant import enter\n"
        "from nathlon.policies.sources.finding import checkpoints_below\n"
        "from nathlon.sim.errors import InputError\n"
        "os.setegid(65534)\nos.seteuid(65534)\n"
        "closed = checkpoints_below(Path(sys.argv[1]))[-1]\n"
        "try:\n    enter(str(closed), 'lindenring', 'gt3')\n"
        "except InputError as error:\n    print(error)\n"
    )
    for folder in (watched, *watched.parents):
        if folder.stat().st_uid == os.geteuid() and str(folder).startswith("/tmp/"):
            folder.chmod(0o755)
    environment = os.environ | {
        "PYTHONPATH": str(Path(__file__).parent.parent.parent),
        "XDG_CACHE_HOME": "/nowhere",
    }
    told = subprocess.check_output([sys.executable, "-c", script, watched], text=True, env=environment)
    assert told.startswith(f"{watched}/closed: ")
