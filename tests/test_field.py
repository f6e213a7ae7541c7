"""Which checkpoints are new, and which files are set aside."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from arena.entrant import enter
from arena.pool import Pool
from nathlon.field import newcomers
from sim.errors import InputError
from tests.checkpoints import BUNDLED

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
    new, excluded = newcomers(pool, [str(watched)], *PAIR, known={})
    assert {entrant.name: entrant.id for entrant in new} == {
        "step": enter(str(BUNDLED[0]), *PAIR).id,
        "b/step": enter(str(BUNDLED[1]), *PAIR).id,
    }
    assert [item.source for item in excluded] == [str(watched / "c" / "broken.safetensors")]
    assert "broken.safetensors" in excluded[0].reason


def test_what_is_known_or_was_refused_is_not_new(watched: Path, pool: Pool) -> None:
    new, excluded = newcomers(pool, [str(watched)], *PAIR, known={})
    known = {entrant.id: entrant.name for entrant in new[:1]}
    again, nothing = newcomers(pool, [str(watched)], *PAIR, known, {item.key for item in excluded})
    assert [entrant.id for entrant in again] == [new[1].id]
    assert not nothing
    (watched / "c" / "broken.safetensors").write_bytes(b"another")
    _, changed = newcomers(pool, [str(watched)], *PAIR, known, {item.key for item in excluded})
    assert len(changed) == 1


def test_a_name_that_is_taken_on_an_earlier_night_is_not_given_again(watched: Path, pool: Pool) -> None:
    new, _ = newcomers(pool, [str(watched / "a")], *PAIR, known={"another": "step"})
    assert new[0].name == "a/step"
    new, _ = newcomers(pool, [str(watched / "a")], *PAIR, known={"another": "step", "third": "a/step"})
    assert new[0].name == f"a/step-{new[0].id[:6]}"


def test_another_circuit_is_set_aside(watched: Path, pool: Pool) -> None:
    new, excluded = newcomers(pool, [str(watched / "a")], "porto-sereno", "coupe", known={})
    assert not new
    assert "circuit is 'lindenring', expected 'porto-sereno'" in excluded[0].reason


def test_an_empty_folder_holds_nothing_yet_and_a_missing_one_is_refused(tmp_path: Path, pool: Pool) -> None:
    assert newcomers(pool, [str(tmp_path)], *PAIR, known={}) == ([], [])
    with pytest.raises(InputError, match="none: no such file or folder"):
        newcomers(pool, [str(tmp_path / "none")], *PAIR, known={})
